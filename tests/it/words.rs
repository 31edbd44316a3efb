//! A language model's words: a server that speaks the protocol, its faults, stored answers, and models that are wrong.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::{Duration, Instant};

use paws_twin::articulation::{Articulation, JointKind};
use paws_twin::config::Config;
use paws_twin::evaluation::{EvaluationReport, Rule, Truth, evaluate};
use paws_twin::fitting;
use paws_twin::geometry::segments::Lsd;
use paws_twin::pipeline;
use paws_twin::reasoning::Reasoner;
use paws_twin::reasoning::asking::Asking;
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::reasoning::prompts::Prompts;
use paws_twin::recording::Recording;
use paws_twin::report::files::predictions;
use paws_twin::synth::{SynthOptions, Tier};
use paws_twin::vlm::server::{ApiKey, RequestLimits, Server};
use paws_twin::vlm::{EncodedPicture, LanguageModel, PictureQuestion, Sampling, Usage};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::common::{SMALL, copy, python, record, stderr, tree};
use crate::simulated::{Errors, Simulated};

/// A request as the server got it.
pub struct Got {
    head: String,
    body: Value,
}

impl Got {
    pub fn text(&self) -> &str {
        self.body["messages"][0]["content"][0]["text"].as_str().unwrap()
    }

    pub fn pictures(&self) -> Vec<&str> {
        let content = self.body["messages"][0]["content"].as_array().unwrap();
        content[1..].iter().map(|p| p["image_url"]["url"].as_str().unwrap()).collect()
    }
}

/// What the server does with a request.
pub struct Reply {
    status: u16,
    headers: String,
    body: Vec<u8>,
    delay: Duration,
    /// Closes the connection instead of answering.
    hangs_up: bool,
}

fn reply(status: u16, headers: &str, body: impl Into<Vec<u8>>) -> Reply {
    Reply { status, headers: headers.to_owned(), body: body.into(), delay: Duration::ZERO, hangs_up: false }
}

/// The reply of a chat completion.
pub fn says(answer: &str) -> Reply {
    let body = json!({"choices": [{"message": {"role": "assistant", "content": answer}, "finish_reason": "stop"}]});
    reply(200, "content-type: application/json\r\n", body.to_string())
}

type Behaviour = dyn Fn(usize, &Got) -> Reply + Send + Sync;

/// A server on this machine; it stops when dropped.
pub struct Mock {
    address: SocketAddr,
    pub got: Arc<Mutex<Vec<Got>>>,
    busiest: Arc<AtomicUsize>,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Mock {
    pub fn new(behaviour: impl Fn(usize, &Got) -> Reply + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (got, busiest, stop) =
            (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
        let behaviour: Arc<Behaviour> = Arc::new(behaviour);
        let busy = Arc::new(AtomicUsize::new(0));
        let thread = {
            let (got, busiest, stop) = (Arc::clone(&got), Arc::clone(&busiest), Arc::clone(&stop));
            std::thread::spawn(move || {
                for stream in listener.incoming() {
                    if stop.load(Ordering::SeqCst) {
                        break;
                    }
                    let Ok(stream) = stream else { continue };
                    let (got, behaviour) = (Arc::clone(&got), Arc::clone(&behaviour));
                    let (busy, busiest) = (Arc::clone(&busy), Arc::clone(&busiest));
                    std::thread::spawn(move || {
                        busiest.fetch_max(busy.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                        serve(stream, &got, &*behaviour, || {
                            busy.fetch_sub(1, Ordering::SeqCst);
                        });
                    });
                }
            })
        };
        Self { address, got, busiest, stop, thread: Some(thread) }
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    fn requests(&self) -> usize {
        self.got.lock().unwrap().len()
    }
}

impl Drop for Mock {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Reads one request and answers it; a client that hangs up in between is not the server's trouble. `done` comes before
/// the last byte is sent: the client may come back at once.
fn serve(mut stream: TcpStream, got: &Mutex<Vec<Got>>, behaviour: &Behaviour, done: impl FnOnce()) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let mut head = String::new();
    loop {
        let mut line = String::new();
        match reader.read_line(&mut line) {
            Ok(n) if n > 0 && line != "\r\n" => head += &line,
            Ok(n) if n > 0 => break,
            _ => {
                done();
                return;
            }
        }
    }
    let length = head
        .lines()
        .filter_map(|l| l.split_once(':'))
        .find(|(name, _)| name.eq_ignore_ascii_case("content-length"))
        .map_or(0, |(_, value)| value.trim().parse().unwrap());
    let mut body = vec![0; length];
    if reader.read_exact(&mut body).is_err() {
        done();
        return;
    }
    let request = Got { head, body: serde_json::from_slice(&body).unwrap_or_default() };
    let number = got.lock().unwrap().len();
    let reply = behaviour(number, &request);
    got.lock().unwrap().push(request);
    std::thread::sleep(reply.delay);
    done();
    if reply.hangs_up {
        return;
    }
    let head = format!(
        "HTTP/1.1 {} Whatever\r\ncontent-length: {}\r\nconnection: close\r\n{}\r\n",
        reply.status,
        reply.body.len(),
        reply.headers
    );
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&reply.body));
}

fn question(text: &str) -> PictureQuestion {
    PictureQuestion {
        purpose: "clip/name".to_owned(),
        text: text.to_owned(),
        pictures: vec![EncodedPicture { bytes: vec![0xff, 0xd8, 0xff], mime: "image/jpeg", size: [8, 8] }],
        sampling: Sampling { temperature: 0.5, top_p: 0.3, max_tokens: 300 },
    }
}

/// Limits of an impatient test.
fn limits() -> RequestLimits {
    RequestLimits {
        connect: Duration::from_secs(1),
        request: Duration::from_millis(400),
        tries: 3,
        first_pause: Duration::from_millis(5),
        patience: Duration::from_secs(3),
        at_once: 2,
        max_requests: 100,
    }
}

/// One question to a server of some behaviour: the answer, what was counted, and how many requests the server got.
fn ask(behaviour: impl Fn(usize, &Got) -> Reply + Send + Sync + 'static) -> (Option<String>, Usage, usize) {
    let mock = Mock::new(behaviour);
    let server = Server::new(&mock.url(), "m", None, limits()).unwrap();
    let answer = server.ask(&question("which?")).unwrap();
    (answer, server.usage(), mock.requests())
}

/// A fault ends without an answer, with a reason that holds `word`, after so many requests (0: any number).
fn fault(name: &str, word: &str, requests: usize, behaviour: impl Fn(usize, &Got) -> Reply + Send + Sync + 'static) {
    let begin = Instant::now();
    let (answer, usage, sent) = ask(behaviour);
    assert_eq!(answer, None, "{name}");
    assert_eq!((usage.asked, usage.failures()), (1, 1), "{name}");
    let reason = usage.failed.keys().next().unwrap();
    assert!(!reason.is_empty() && reason.contains(word), "{name}: {reason}");
    assert!(requests == 0 || (sent, usage.requests) == (requests, requests), "{name}: {sent} {usage:?}");
    assert!(begin.elapsed() < Duration::from_secs(5), "{name}: {:?}", begin.elapsed());
}

#[test]
fn every_fault_ends_with_a_word_in_bounded_time_and_requests() {
    fault("slow", "no answer within", 3, |_, _| Reply { delay: Duration::from_secs(2), ..says("a") });
    fault("closed", "", 3, |_, _| Reply { hangs_up: true, ..says("a") });
    fault("malformed", "no JSON", 1, |_, _| reply(200, "", "{\"choices\": ["));
    fault("429 storm", "HTTP 429", 3, |_, _| reply(429, "retry-after: 0.01\r\n", "slow down"));
    fault("429 for an hour", "HTTP 429", 1, |_, _| reply(429, "retry-after: 3600\r\n", ""));
    fault("503", "HTTP 503", 3, |_, _| reply(503, "", ""));
    fault("10 MB", "above 1 MiB", 1, |_, _| reply(200, "", vec![b' '; 10 << 20]));
    fault("a web page", "is the address right", 1, |_, _| reply(200, "content-type: text/html\r\n", "<html>"));
    fault("no such model", "no model m", 1, |_, _| reply(404, "", "{\"error\":{\"message\":\"no model m\"}}"));
    fault("redirect", "redirect", 1, |_, _| reply(307, "location: http://127.0.0.1:9/\r\n", ""));
    fault("no HTTP", "", 0, |_, _| reply(200, "broken\r\n", ""));
}

#[test]
fn a_passing_fault_passes_and_a_wrong_content_type_is_forgiven() {
    let (answer, usage, sent) = ask(|n, _| if n == 0 { reply(503, "", "") } else { says(" drawer:translation\n") });
    assert_eq!((answer.as_deref(), sent, usage.requests, usage.asked), (Some("drawer:translation"), 2, 2, 1));
    let plain = |_: usize, _: &Got| Reply { headers: "content-type: text/plain\r\n".to_owned(), ..says("none") };
    assert_eq!(ask(plain).0.as_deref(), Some("none"));
}

#[test]
fn a_refused_key_ends_the_run_and_is_not_repeated() {
    const SECRET: &str = "sk-0123456789abcdef";
    let mock = Mock::new(|_, got| reply(401, "", format!("wrong key: {}", got.head)));
    let key = ApiKey::new("MY_KEY", SECRET).unwrap();
    let server = Server::new(&mock.url(), "m", Some(key), limits()).unwrap();
    let error = server.ask(&question("which?")).unwrap_err().to_string();
    assert!(error.contains("401") && error.contains("MY_KEY") && !error.contains(SECRET), "{error}");
    assert!(mock.got.lock().unwrap()[0].head.contains(SECRET));
    let server = Server::new(&mock.url(), "m", None, limits()).unwrap();
    assert!(server.ask(&question("which?")).unwrap_err().to_string().contains("--vlm-key-env"));
    // A server that parrots the key in its answer.
    let mock = Mock::new(|_, got| says(&format!("drawer:translation {}", got.head.replace("\r\n", " "))));
    let server = Server::new(&mock.url(), "m", Some(ApiKey::new("MY_KEY", SECRET).unwrap()), limits()).unwrap();
    let answer = server.ask(&question("which?")).unwrap().unwrap();
    assert!(answer.contains("***") && !answer.contains(SECRET), "{answer}");
}

#[test]
fn no_more_requests_than_allowed_whatever_fails_and_however_many_ask() {
    let mock = Mock::new(|_, _| reply(500, "", ""));
    let server = Server::new(&mock.url(), "m", None, RequestLimits { max_requests: 7, ..limits() }).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..3 {
                    assert_eq!(server.ask(&question("which?")).unwrap(), None);
                }
            });
        }
    });
    assert_eq!((mock.requests(), server.usage().requests), (7, 7));
    let usage = server.usage();
    assert_eq!(usage.failures() + usage.refused, 12, "{usage:?}");
    assert!(usage.sentence("m").contains("--max-requests") || usage.refused == 0, "{usage:?}");
}

#[test]
fn no_more_at_the_same_time_than_allowed() {
    let mock = Mock::new(|_, _| Reply { delay: Duration::from_millis(20), ..says("none") });
    let server =
        Server::new(&mock.url(), "m", None, RequestLimits { request: Duration::from_secs(5), ..limits() }).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..6 {
            scope.spawn(|| {
                for _ in 0..2 {
                    assert_eq!(server.ask(&question("which?")).unwrap().as_deref(), Some("none"));
                }
            });
        }
    });
    assert_eq!(mock.requests(), 12);
    assert!(mock.busiest.load(Ordering::SeqCst) <= 2, "{:?}", mock.busiest);
}

#[test]
fn a_server_that_is_not_there_is_not_asked_forever() {
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let server = Server::new(&format!("http://{address}"), "m", None, limits()).unwrap();
    let begin = Instant::now();
    for _ in 0..200 {
        assert_eq!(server.ask(&question("which?")).unwrap(), None);
    }
    let usage = server.usage();
    assert_eq!((usage.failures(), usage.requests), (200, 15), "{usage:?}");
    assert!(usage.sentence("m").contains("connection"), "{}", usage.sentence("m"));
    assert!(begin.elapsed() < Duration::from_secs(10));
}

const KEY: &str = "sk-the-key-of-the-test-0123456789";

/// `paws` with the key in an environment variable.
fn paws(args: &[&str], dir: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_paws")).args(args).env("PAWS_TEST_KEY", KEY).current_dir(dir).output().unwrap()
}

/// A model for which everything turns, about the first line.
fn everything_turns(got: &Got) -> Reply {
    says(if got.text().contains("white number") { "Line 1: cupboard door hinge" } else { "cupboard:rotation" })
}

fn holds(bytes: &[u8], word: &str) -> bool {
    bytes.windows(word.len()).any(|w| w == word.as_bytes())
}

#[test]
fn a_twin_is_asked_for_once_and_the_same_ever_after() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    let mock = Mock::new(|_, got| everything_turns(got));
    let url = format!("{}/v1/", mock.url());
    let args = ["twin", "rec", "--out", "t", "--keep", "--vlm-model", "test-model"];
    let asking: Vec<&str> = args.into_iter().chain(["--vlm-url", &url, "--vlm-key-env", "PAWS_TEST_KEY"]).collect();

    let first = paws(&asking, dir.path());
    assert_ne!(first.status.code(), Some(2), "{}", stderr(&first));
    let requests = mock.requests();
    {
        let got = mock.got.lock().unwrap();
        let motion: Vec<&Got> = got.iter().filter(|g| g.pictures().len() == 1).collect();
        assert!(motion.len() >= 10 && got.iter().any(|g| g.pictures().is_empty()), "{requests} requests");
        for g in got.iter() {
            assert_eq!(g.body["model"], "test-model");
            assert_eq!((&g.body["temperature"], &g.body["top_p"]), (&json!(0.5), &json!(0.3)));
            assert!(g.head.starts_with("POST /v1/chat/completions "), "{}", g.head);
            assert!(g.head.to_lowercase().contains(&format!("authorization: bearer {KEY}")), "{}", g.head);
            // A JPEG begins with ff d8 ff.
            assert!(g.pictures().iter().all(|p| p.starts_with("data:image/jpeg;base64,/9j/")));
        }
    }
    assert!(stderr(&first).contains(&format!("test-model: {requests} questions asked in {requests} requests")));
    let whole = tree(&dir.path().join("t"));
    assert!(whole.keys().any(|name| name.contains("/vlm/motion_01_frame_") && name.ends_with(".jpg")));
    let articulations = String::from_utf8_lossy(&whole["articulations.json"]).into_owned();
    assert!(articulations.contains("(test-model)") && articulations.contains("\"revolute\": 10"), "{articulations}");
    let answers = tree(&dir.path().join("rec/answers"));
    assert!(!answers.is_empty() && answers.len() <= requests && answers.keys().all(|n| n.ends_with(".json")));

    // The same again asks nothing and writes the same.
    let second = paws(&asking, dir.path());
    assert_eq!((mock.requests(), second.status.code()), (requests, first.status.code()), "{}", stderr(&second));
    assert!(tree(&dir.path().join("t")) == whole, "the second run differs");

    // Nor does it need the server.
    drop(mock);
    let replay: Vec<&str> = args.into_iter().chain(["--replay"]).collect();
    let third = paws(&replay, dir.path());
    assert_eq!(third.status.code(), first.status.code(), "{}", stderr(&third));
    assert!(tree(&dir.path().join("t")) == whole, "the replay differs");

    for (name, bytes) in tree(dir.path()) {
        assert!(!holds(&bytes, KEY), "{name} holds the key");
    }
    for output in [&first, &second, &third] {
        assert!(!holds(&output.stdout, KEY) && !holds(&output.stderr, KEY));
    }
}

#[test]
fn the_budget_holds_on_the_command_line_and_a_dry_run_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    let dry = paws(&["twin", "rec", "--out", "t", "--vlm-model", "m", "--dry-run"], dir.path());
    let text = String::from_utf8_lossy(&dry.stdout).into_owned();
    assert_eq!(dry.status.code(), Some(0), "{}", stderr(&dry));
    assert!(text.contains("m: at most") && text.contains("Nothing was asked"), "{text}");
    assert!(!dir.path().join("t").exists() && !dir.path().join("rec/answers").exists());

    let mock = Mock::new(|_, got| everything_turns(got));
    let args =
        ["infer", "rec", "--vlm-model", "m", "--vlm-url", &mock.url(), "--max-requests", "7", "--answers", "kept"];
    let out = paws(&args, dir.path());
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    assert_eq!((mock.requests(), tree(&dir.path().join("kept")).len()), (7, 7));
    assert!(stderr(&out).contains("not asked") && !dir.path().join("rec/answers").exists(), "{}", stderr(&out));
    // Going on costs what is left only.
    paws(&args, dir.path());
    assert_eq!(mock.requests(), 14);
}

#[test]
fn what_cannot_be_asked_is_told_at_once() {
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    let mock = Mock::new(|_, got| reply(401, "", got.head.clone()));
    let url = mock.url();
    let https = "https://127.0.0.1:9";
    let mut cases: Vec<(Vec<&str>, &str)> = vec![
        (vec!["--vlm-url", &url, "--vlm-model", "m", "--vlm-key-env", "PAWS_TEST_KEY"], "PAWS_TEST_KEY"),
        (vec!["--vlm-url", &url, "--vlm-model", "m", "--vlm-key-env", KEY], "not a key"),
        (vec!["--vlm-url", &url, "--vlm-model", "m", "--vlm-key-env", "PAWS_NO_SUCH"], "is not set"),
        (vec!["--vlm-url", &url, "--vlm-model", "m", "--vlm-key", KEY], "--vlm-key"),
        (vec!["--vlm-url", &url], "--vlm-model"),
        (vec!["--vlm-url", "127.0.0.1", "--vlm-model", "m"], "http://"),
        (vec!["--vlm-model", "m"], "--vlm-url"),
        (vec!["--vlm-model", "m", "--kept-answers", "--templates", "rec"], "axis_choice.txt"),
        (vec!["--vlm-model", "m", "--replay", "--answers", "t/answers"], "--answers"),
    ];
    if cfg!(not(feature = "vlm-https")) {
        cases.push((vec!["--vlm-url", https, "--vlm-model", "m"], "vlm-https"));
    }
    for (more, word) in cases {
        let args: Vec<&str> = ["twin", "rec", "--out", "t"].into_iter().chain(more.iter().copied()).collect();
        let out = paws(&args, dir.path());
        assert_eq!(out.status.code(), Some(2), "{more:?}: {}", stderr(&out));
        assert!(stderr(&out).contains(word) && !stderr(&out).contains(KEY), "{more:?}: {}", stderr(&out));
        let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["rec"], "{more:?}");
    }
}

/// A process that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_real_server_answers_about_real_pictures() {
    let Some(python) = python("words") else { return };
    let dir = tempfile::tempdir().unwrap();
    copy(SMALL.path(), &dir.path().join("rec"));
    let log = dir.path().join("server.log");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/words/tiny_server.py");
    let mut server = Running(
        Command::new(python)
            .arg(script)
            .arg(dir.path().join("model"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(&log).unwrap())
            .spawn()
            .unwrap(),
    );
    let mut lines = BufReader::new(server.0.stdout.take().unwrap()).lines();
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || send.send(lines.next()));
    let url = match receive.recv_timeout(Duration::from_secs(120)) {
        Ok(Some(Ok(url))) => url,
        other => panic!("the server did not start ({other:?}): {}", std::fs::read_to_string(&log).unwrap()),
    };
    let out = paws(&["twin", "rec", "--out", "t", "--vlm-url", &url, "--vlm-model", "tiny"], dir.path());
    assert_ne!(out.status.code(), Some(2), "{}", stderr(&out));
    assert!(stderr(&out).contains("tiny: ") && !stderr(&out).contains("without an answer"), "{}", stderr(&out));
    let articulations = std::fs::read_to_string(dir.path().join("t/articulations.json")).unwrap();
    for word in ["\"revolute\": 10", "\"summary\": \"revolute\"", "\"furniture\": \"cupboard\""] {
        assert!(articulations.contains(word), "{word}: {articulations}");
    }
}

/// A kitchen with short motions and vague narrations, where words count.
static KITCHEN: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    record(&SynthOptions { seed: 104, tier: Tier::Hard, width: 320, parts: 6 }, dir.path());
    dir
});

fn geometric() -> Geometric {
    let config = Config::default();
    Geometric::of(&config)
}

fn report(reasoner: &dyn Reasoner) -> EvaluationReport {
    let config = Config::default();
    let recording = Recording::open(KITCHEN.path()).unwrap();
    let scene = pipeline::infer(&recording, &config, &Lsd, reasoner, &|_, _, _| {}).unwrap();
    let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
    evaluate(&predictions(&scene, &twin), &[Truth::read(KITCHEN.path()).unwrap()])
}

/// The true joint of every clip that shows one.
fn joints() -> BTreeMap<String, Articulation> {
    let truth = Truth::read(KITCHEN.path()).unwrap();
    let joint =
        |c: paws_twin::evaluation::truth::TrueClip| Articulation { kind: c.kind, axis: c.axis, origin: c.origin };
    truth.clips.into_iter().filter_map(|(name, clip)| Some((name, joint(clip?)))).collect()
}

#[test]
fn a_model_that_is_wrong_does_not_sink_the_inference() {
    let geometric = geometric();
    let shares = |report: &EvaluationReport| report.rules.iter().find(|r| r.rule == Rule::UsdnetMaoSt).unwrap().micro;
    let alone = shares(&report(&geometric));
    eprintln!("geometry alone: M {:.2} MA {:.2} MAO {:.2}", alone.m, alone.ma, alone.mao);
    for (name, errors, loss) in [
        ("never wrong", Errors::Random { kind: 0.0, line: 0.0 }, 0.05),
        ("30 % wrong", Errors::Random { kind: 0.3, line: 0.3 }, 0.2),
        ("always says hinge", Errors::Always(JointKind::Revolute), 0.2),
        ("always says slide", Errors::Always(JointKind::Prismatic), 0.2),
    ] {
        let reasoner = Simulated { geometric: &geometric, truth: joints(), errors, seed: 1 };
        let with = shares(&report(&reasoner));
        eprintln!("a model that is {name}: M {:.2} MA {:.2} MAO {:.2}", with.m, with.ma, with.mao);
        assert!(with.m >= alone.m - loss && with.ma >= alone.ma - loss, "{name}: {with:?}, alone {alone:?}");
    }
}

/// Answers from the picture's side of the question only: it keeps what it was asked.
struct Listener {
    asked: Mutex<Vec<PictureQuestion>>,
}

impl LanguageModel for Listener {
    fn ask(&self, question: &PictureQuestion) -> paws_twin::error::Result<Option<String>> {
        self.asked.lock().unwrap().push(question.clone());
        Ok(Some("unknown".to_owned()))
    }

    fn name(&self) -> &str {
        "listener"
    }

    fn usage(&self) -> Usage {
        Usage::default()
    }
}

#[test]
fn every_clip_is_asked_about_its_frames_and_the_lines_of_its_views() {
    let (mut geometric, prompts) = (geometric(), Prompts::built_in().unwrap());
    geometric.reasoning.vlm_views = 8;
    let recording = Recording::open(KITCHEN.path()).unwrap();
    let listen = |at_once: usize| {
        let model = Listener { asked: Mutex::default() };
        let asking = Asking { geometric: &geometric, model: &model, prompts: &prompts, at_once };
        let scene = pipeline::infer(&recording, &Config::default(), &Lsd, &asking, &|_, _, _| {}).unwrap();
        let mut asked = model.asked.into_inner().unwrap();
        asked.sort_by(|a, b| a.purpose.cmp(&b.purpose));
        (scene, asked)
    };
    let (scene, asked) = listen(1);
    let of = |clip: &str, what: &str| asked.iter().filter(|q| q.purpose.starts_with(&format!("{clip}/{what}"))).count();
    let mut views = 0;
    for clip in scene.clips.iter().filter(|c| c.words.is_some()) {
        let name = &clip.clip.clip;
        assert_eq!((of(name, "motion_"), of(name, "summary")), (10, 1), "{name}");
        views += of(name, "axis_view_");
        let words = clip.words.as_ref().unwrap();
        assert_eq!((words.unknown, words.log_odds(&Config::default().reasoning)), (10, 0.0));
    }
    assert!(views > 20, "{views} views with lines");
    for question in &asked {
        assert!(question.pictures.iter().all(|p| p.size == [320, 240] && p.bytes.starts_with(&[0xff, 0xd8])));
        let lines = question.text.contains("white number");
        assert_eq!(lines, question.purpose.contains("/axis_view_"));
        assert!(!lines || (1..=4).any(|n| question.text.contains(&format!("{n} straight line"))), "{}", question.text);
    }
    // Threads change the order, not the questions.
    assert!(listen(4).1 == asked);
}
