//! Small files that ask for much: what they cost is bounded, and they are told why.

use std::path::PathBuf;

use paws_twin::model::{self, Model, furniture};

fn read(text: &str) -> std::result::Result<Model, String> {
    let dir = tempfile::tempdir().unwrap();
    let path: PathBuf = dir.path().join("m.xml");
    std::fs::write(&path, text).unwrap();
    model::read(&path).map_err(|e| e.to_string())
}

#[test]
fn classes_that_all_inherit_a_large_one_are_refused() {
    let value = "1 ".repeat(2000);
    let main: String = (0..250).map(|i| format!("k{i}='{value}' ")).collect();
    let classes: String = (0..100).map(|i| format!("<default class='c{i}'/>")).collect();
    let text = format!("<mujoco><default><geom {main}/>{classes}</default><worldbody/></mujoco>");
    let error = read(&text).unwrap_err();
    assert!(error.contains("m.xml: line 1, <default") && error.contains("classes take more than 64 MiB"), "{error}");
}

#[test]
fn copies_of_elements_with_many_attributes_are_counted_with_them() {
    let attributes: String = (0..50).map(|i| format!("k{i}='1' ")).collect();
    let text = format!(
        "<mujoco><worldbody><replicate count='100000' offset='0 0 1'><geom size='.1' {attributes}/></replicate></worldbody>\
         </mujoco>"
    );
    let error = read(&text).unwrap_err();
    assert!(error.contains("<replicate>") && error.contains("makes more than 1000000"), "{error}");
}

#[test]
fn excludes_between_all_copies_of_two_bodies_are_passed_over_where_they_are_too_many() {
    let copies = |name: &str, count: usize| {
        format!("<replicate count='{count}' offset='0 0 1'><body name='{name}'><geom size='.1'/></body></replicate>")
    };
    let with = |count: usize| {
        let text = format!(
            "<mujoco><worldbody>{}{}</worldbody><contact><exclude body1='a' body2='b'/></contact></mujoco>",
            copies("a", count),
            copies("b", count)
        );
        read(&text).unwrap()
    };
    let few = with(3);
    assert_eq!((few.excludes.len(), few.notes.iter().any(|n| n.contains("<exclude>"))), (9, false));
    let many = with(1500);
    assert_eq!(many.excludes.len(), 0);
    assert!(many.notes.iter().any(|n| n.contains("not read: 1 x <exclude>")), "{:?}", many.notes);
}

#[test]
fn what_is_wrong_with_a_tree_is_not_told_whole_to_every_joint() {
    let links = "<link name='a'/>".repeat(300);
    let joints: String = (0..300)
        .map(|i| format!("<joint name='j{i}' type='revolute'><parent link='a'/><child link='b{i}'/></joint>"))
        .collect();
    let model = read(&format!("<robot name='r'>{links}{joints}</robot>")).unwrap();
    let (twin, _) = furniture::to_twin(&model);
    assert_eq!(twin.left_out.len(), 300);
    let reason = &twin.left_out[0].reason;
    assert!(reason.contains("two links are named a") && reason.ends_with("more") && reason.len() < 400, "{reason}");
}
