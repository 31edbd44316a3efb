//! Synthetic kitchens of wood, tiles, stone and steel: the answer does not follow the grain, and the twin's textures keep it.

use paws_twin::appearance;
use paws_twin::config;
use paws_twin::evaluation::likeness::{self, Contender, Over};
use paws_twin::evaluation::shots;
use paws_twin::evaluation::{Rule, Truth, evaluate};
use paws_twin::look::Look;
use paws_twin::recording::Recording;
use paws_twin::report::files::predictions;
use paws_twin::report::page_frames;
use paws_twin::synth::{Changes, SynthOptions, Tier};

use crate::common::{record, record_varied, twin_of};

fn dressed() -> Changes {
    Changes { materials: true, ..Changes::default() }
}

#[test]
fn joints_are_as_right_as_on_flat_colours() {
    let dir = tempfile::tempdir().unwrap();
    record_varied(&SynthOptions { seed: 101, tier: Tier::Clean, width: 320, parts: 6 }, &dressed(), dir.path());
    let (_, scene, twin) = twin_of(dir.path());
    let report = evaluate(&predictions(&scene, &twin), &[Truth::read(dir.path()).unwrap()]);
    assert_eq!((report.answered, report.clips, report.false_positives), (12, 12, 0));
    let micro = report.rules.iter().find(|r| r.rule == Rule::Sim).unwrap().micro;
    assert_eq!([micro.m, micro.ma, micro.mao], [1.0; 3], "{:#?}", report.per_clip);
}

#[test]
fn textures_keep_what_surfaces_are_made_of() {
    let [flat, real] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let options = SynthOptions { seed: 3, tier: Tier::Clean, width: 240, parts: 1 };
    record(&options, flat.path());
    record_varied(&options, &dressed(), real.path());
    let (recording, scene, twin) = twin_of(real.path());
    // Both recordings show the same surfaces from the same places: only the colours differ.
    let small = config::Appearance { triangles: 20_000, ..Default::default() };
    let look = |of: &Recording| appearance::look(of, &scene, &twin, &config::Hands::default(), &small).unwrap();
    let looks = [look(&recording), look(&Recording::open(flat.path()).unwrap())];
    let few = config::Comparison { frames: 6, open_frames: 0, ..Default::default() };
    let timelines = page_frames::timelines(&recording, &scene, &twin, &config::Hands::default());
    let shots = shots::choose(&recording, &twin, &timelines, &few);
    let [own, other] = looks.map(|look: Look| {
        let contender = Contender { name: "twin".to_owned(), surfaces: likeness::surfaces(&twin, Some(&look), &[]) };
        let rows = likeness::compare(&recording, &twin, &[contender], &shots.chosen, &few).unwrap();
        let all = likeness::summaries(&["twin".to_owned()], &rows);
        all.into_iter().find(|s| s.over == Over::Closed).unwrap()
    });
    assert!(own.coverage > 0.8 && (own.coverage - other.coverage).abs() < 0.01, "{own:?} {other:?}");
    assert!(own.psnr_db.unwrap() > other.psnr_db.unwrap() + 0.5, "{own:?} {other:?}");
    assert!(own.ssim.unwrap() > other.ssim.unwrap(), "{own:?} {other:?}");
}
