//! The prompts (§A.6, in our own words): templates that users can replace.

use std::path::Path;

use minijinja::{Environment, UndefinedBehavior};
use serde::Serialize;

use crate::error::{Error, Result};

/// What the motion type's template is filled with.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MotionType<'a> {
    /// Place of the frame among those shown, from 1.
    pub frame_number: usize,
    /// Frames shown.
    pub total_frames: usize,
    /// What the person is said to do.
    pub narration: &'a str,
    /// What the masks call the furniture at the hand.
    pub fixture: Option<&'a str>,
}

/// What the summary's template is filled with.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Summary<'a> {
    /// Frames shown.
    pub total_frames: usize,
    /// What the person is said to do.
    pub narration: &'a str,
    /// What the masks call the furniture at the hand.
    pub fixture: Option<&'a str>,
    /// The answer for each frame, in order.
    pub answers: &'a [String],
}

/// What the axis choice's template is filled with.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct AxisChoice<'a> {
    /// Lines in the picture.
    pub count: usize,
    /// Their numbers ("1, 2 and 3").
    pub numbers: &'a str,
    /// The furniture, where a name is known.
    pub furniture: Option<&'a str>,
    /// What the person is said to do.
    pub narration: &'a str,
}

/// What the template for a clip's name is filled with.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct NameQuestion<'a> {
    /// Pictures shown.
    pub count: usize,
    /// Names of furniture to choose from ("drawer, fridge").
    pub names: &'a str,
}

/// A template: its file, its built-in text, and the variables that it may use.
struct Template {
    file: &'static str,
    built_in: &'static str,
    variables: &'static [&'static str],
}

const MOTION_TYPE: Template = Template {
    file: "motion_type.txt",
    built_in: include_str!("../../templates/motion_type.txt"),
    variables: &["fixture", "frame_number", "narration", "total_frames"],
};
const SUMMARY: Template = Template {
    file: "summary.txt",
    built_in: include_str!("../../templates/summary.txt"),
    variables: &["answers", "fixture", "narration", "total_frames"],
};
const AXIS_CHOICE: Template = Template {
    file: "axis_choice.txt",
    built_in: include_str!("../../templates/axis_choice.txt"),
    variables: &["count", "furniture", "narration", "numbers"],
};
const NAMING: Template = Template {
    file: "naming.txt",
    built_in: include_str!("../../templates/naming.txt"),
    variables: &["count", "names"],
};
const ALL: [&Template; 4] = [&MOTION_TYPE, &SUMMARY, &AXIS_CHOICE, &NAMING];

/// The four prompts.
#[derive(Debug)]
pub struct Prompts {
    environment: Environment<'static>,
}

impl Prompts {
    /// The built-in prompts.
    ///
    /// # Errors
    /// None, short of a bug.
    pub fn built_in() -> Result<Self> {
        Self::with(|template| Ok(template.built_in.to_owned()))
    }

    /// Those of a folder's `motion_type.txt`, `summary.txt`, `axis_choice.txt` and `naming.txt` that are there, the built-in
    /// ones for the rest.
    ///
    /// # Errors
    /// Where none is there, or one cannot be used: its syntax, or a variable that it will not get.
    pub fn read(dir: &Path) -> Result<Self> {
        if !ALL.iter().any(|t| dir.join(t.file).is_file()) {
            let message = "holds no motion_type.txt, summary.txt, axis_choice.txt or naming.txt; start from the project's \
                           templates/";
            return Err(Error::Io { path: dir.to_owned(), message: message.to_owned() });
        }
        Self::with(|template| {
            let path = dir.join(template.file);
            if !path.is_file() {
                return Ok(template.built_in.to_owned());
            }
            std::fs::read_to_string(&path).map_err(|e| Error::io(&path, &e))
        })
    }

    fn with(source: impl Fn(&Template) -> Result<String>) -> Result<Self> {
        let mut environment = Environment::new();
        environment.set_undefined_behavior(UndefinedBehavior::SemiStrict);
        for template in ALL {
            environment.add_template_owned(template.file, source(template)?).map_err(|e| fault(template, &e))?;
            let parsed = environment.get_template(template.file).map_err(|e| fault(template, &e))?;
            let mut unknown: Vec<String> = parsed
                .undeclared_variables(false)
                .into_iter()
                .filter(|name| !template.variables.contains(&name.as_str()))
                .collect();
            unknown.sort_unstable();
            if let Some(name) = unknown.first() {
                let known = template.variables.join(", ");
                return Err(Error::Config(format!(
                    "{}: {{{{ {name} }}}} is not known; known are {known}",
                    template.file
                )));
            }
        }
        Ok(Self { environment })
    }

    /// The question for the motion type in one frame.
    ///
    /// # Errors
    /// Where the template cannot be filled.
    pub fn motion_type(&self, values: &MotionType) -> Result<String> {
        self.render(&MOTION_TYPE, values)
    }

    /// The question for the motion type of the whole clip.
    ///
    /// # Errors
    /// Where the template cannot be filled.
    pub fn summary(&self, values: &Summary) -> Result<String> {
        self.render(&SUMMARY, values)
    }

    /// The question for the hinge among the numbered lines of a view.
    ///
    /// # Errors
    /// Where the template cannot be filled.
    pub fn axis_choice(&self, values: &AxisChoice) -> Result<String> {
        self.render(&AXIS_CHOICE, values)
    }

    /// The question for the furniture that a clip shows, and for what is done to it.
    ///
    /// # Errors
    /// Where the template cannot be filled.
    pub fn naming(&self, values: &NameQuestion) -> Result<String> {
        self.render(&NAMING, values)
    }

    fn render(&self, template: &Template, values: impl Serialize) -> Result<String> {
        self.environment
            .get_template(template.file)
            .and_then(|t| t.render(minijinja::value::Serde(values)))
            .map_err(|e| fault(template, &e))
    }
}

fn fault(template: &Template, error: &minijinja::Error) -> Error {
    Error::Config(format!("{}: {error}", template.file))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(values: impl Serialize) -> Vec<String> {
        let value = serde_json::to_value(values).unwrap();
        value.as_object().unwrap().keys().cloned().collect()
    }

    #[test]
    fn every_placeholder_is_supplied_and_everything_supplied_is_used() {
        let prompts = Prompts::built_in().unwrap();
        for (template, supplied) in [
            (&MOTION_TYPE, names(MotionType::default())),
            (&SUMMARY, names(Summary::default())),
            (&AXIS_CHOICE, names(AxisChoice::default())),
            (&NAMING, names(NameQuestion::default())),
        ] {
            let parsed = prompts.environment.get_template(template.file).unwrap();
            let mut used: Vec<String> = parsed.undeclared_variables(false).into_iter().collect();
            used.sort_unstable();
            let mut supplied = supplied;
            supplied.sort_unstable();
            assert_eq!(used, supplied, "{}", template.file);
            assert_eq!(template.variables, supplied, "{}", template.file);
        }
    }

    #[test]
    fn the_prompts_say_what_they_are_given() {
        let prompts = Prompts::built_in().unwrap();
        let motion = MotionType { frame_number: 3, total_frames: 10, narration: "open it", fixture: Some("oven") };
        let text = prompts.motion_type(&motion).unwrap();
        assert!(text.contains("image 3 of 10") && text.contains("\"open it\"") && text.contains("\"oven\""), "{text}");
        let text = prompts.motion_type(&MotionType { fixture: None, ..motion }).unwrap();
        assert!(!text.contains("3D reconstruction") && text.contains("furniture:motion"), "{text}");
        let answers = ["drawer:translation".to_owned(), "no answer".to_owned()];
        let text = prompts.summary(&Summary { total_frames: 2, answers: &answers, ..Summary::default() }).unwrap();
        assert!(text.contains("\n1. drawer:translation\n2. no answer\n"), "{text}");
        let one = AxisChoice { count: 1, numbers: "1", ..AxisChoice::default() };
        assert!(prompts.axis_choice(&one).unwrap().contains("1 straight line is drawn"));
        let text = prompts.naming(&NameQuestion { count: 4, names: "drawer, fridge" }).unwrap();
        assert!(text.contains("These 4 pictures") && text.contains("\ndrawer, fridge.\n"), "{text}");
        assert!(text.contains(r#"{"verb": "open", "noun": "cupboard""#), "{text}");
        // What a narration says is text, whatever it looks like.
        let text = prompts.axis_choice(&AxisChoice { narration: "{{ count }} <b>", ..one }).unwrap();
        assert!(text.contains("\"{{ count }} <b>\""), "{text}");
    }

    #[test]
    fn templates_can_be_replaced_one_by_one_and_faults_are_named() {
        let dir = tempfile::tempdir().unwrap();
        assert!(Prompts::read(dir.path()).unwrap_err().to_string().contains("axis_choice.txt"));
        let path = dir.path().join("axis_choice.txt");
        std::fs::write(&path, "Which of {{ numbers }}?").unwrap();
        let prompts = Prompts::read(dir.path()).unwrap();
        let two = AxisChoice { count: 2, numbers: "1 and 2", ..AxisChoice::default() };
        assert_eq!(prompts.axis_choice(&two).unwrap(), "Which of 1 and 2?");
        assert!(prompts.motion_type(&MotionType::default()).unwrap().contains("furniture:motion"));
        for (text, word) in [("{{ number }}", "number"), ("{% if %}", "axis_choice.txt")] {
            std::fs::write(&path, text).unwrap();
            let error = Prompts::read(dir.path()).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
