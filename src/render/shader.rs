//! The WGSL sources, built into the program, and how they are put together.
//!
//! A line `//!include "NAME.wgsl"` stands for that file where it is met first. Lines between `//!if FLAG` and `//!end` are
//! there where the flag is set, those between `//!else` and `//!end` where it is not.

/// All files under `shaders/` by their names, in the order of these; build.rs lists them.
const FILES: &[(&str, &str)] = &include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// A mistake that keeps a shader from being put together.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum ShaderError {
    /// A file that is not there.
    #[error("there is no shader \"{0}\"")]
    UnknownFile(String),
    /// An `//!else` or `//!end` without its `//!if`, an `//!if` without its `//!end`, or another word.
    #[error("{file}: \"{line}\" stands alone or is unknown")]
    BadLine {
        /// The file.
        file: String,
        /// The line.
        line: String,
    },
}

/// The text of one of the files under `shaders/`, with what it includes and what the flags choose.
pub(super) fn source(name: &str, flags: &[&str]) -> Result<String, ShaderError> {
    let file = |name: &str| {
        let mut files = FILES.iter();
        files.find(|(file, _)| *file == name).map(|(_, text)| *text)
    };
    let mut text = String::new();
    expand(name, flags, &file, &mut Vec::new(), &mut text)?;
    Ok(text)
}

/// Appends a file to a text, unless it is there already.
fn expand<'a>(
    name: &str,
    flags: &[&str],
    file: &impl Fn(&str) -> Option<&'a str>,
    included: &mut Vec<String>,
    to: &mut String,
) -> Result<(), ShaderError> {
    if included.iter().any(|known| known == name) {
        return Ok(());
    }
    included.push(name.to_owned());
    let text = file(name).ok_or_else(|| ShaderError::UnknownFile(name.to_owned()))?;
    // For each condition that a line stands under: whether it holds.
    let mut conditions: Vec<bool> = Vec::new();
    let bad = |line: &str| ShaderError::BadLine {
        file: name.to_owned(),
        line: line.to_owned(),
    };
    for line in text.lines() {
        let Some(directive) = line.trim().strip_prefix("//!") else {
            if !conditions.contains(&false) {
                to.push_str(line);
                to.push('\n');
            }
            continue;
        };
        match directive.split_once(' ').unwrap_or((directive, "")) {
            ("if", flag) if !flag.is_empty() => conditions.push(flags.contains(&flag)),
            ("else", "") => {
                let condition = conditions.last_mut().ok_or_else(|| bad(line))?;
                *condition = !*condition;
            }
            ("end", "") => {
                conditions.pop().ok_or_else(|| bad(line))?;
            }
            ("include", quoted) => {
                let inner = quoted.strip_prefix('"').and_then(|it| it.strip_suffix('"'));
                let part = inner.ok_or_else(|| bad(line))?;
                if !conditions.contains(&false) {
                    expand(part, flags, file, included, to)?;
                }
            }
            _ => return Err(bad(line)),
        }
    }
    match conditions.is_empty() {
        true => Ok(()),
        false => Err(bad("//!if")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded(files: &[(&str, &str)], flags: &[&str]) -> Result<String, ShaderError> {
        let file = |name: &str| {
            let found = files.iter().find(|(file, _)| *file == name);
            found.map(|(_, text)| *text)
        };
        let mut text = String::new();
        expand("main", flags, &file, &mut Vec::new(), &mut text)?;
        Ok(text)
    }

    #[test]
    fn parts_are_included_once_each_and_in_their_order() {
        let files = [
            ("main", "//!include \"a\"\n//!include \"b\"\nmain"),
            ("a", "a before\n//!include \"c\"\na"),
            ("b", "//!include \"c\"\n//!include \"main\"\nb"),
            ("c", "c"),
        ];
        assert_eq!(expanded(&files, &[]).unwrap(), "a before\nc\na\nb\nmain\n");
    }

    #[test]
    fn flags_choose_lines() {
        let text = "1\n//!if A\n2\n//!if B\n3\n//!else\n4\n//!end\n//!else\n5\n//!end\n6";
        let chosen = |flags: &[&str]| {
            expanded(&[("main", text)], flags)
                .unwrap()
                .replace('\n', "")
        };
        assert_eq!(chosen(&[]), "156");
        assert_eq!(chosen(&["A"]), "1246");
        assert_eq!(chosen(&["A", "B"]), "1236");
        assert_eq!(chosen(&["B"]), "156");
        // What is not there includes nothing either.
        let text = "//!if A\n//!include \"gone\"\n//!end";
        assert_eq!(expanded(&[("main", text)], &[]).unwrap(), "");
    }

    #[test]
    fn mistakes_are_told() {
        let unknown = Err(ShaderError::UnknownFile("gone".to_owned()));
        assert_eq!(expanded(&[("main", "//!include \"gone\"")], &[]), unknown);
        for text in [
            "//!end",
            "//!else",
            "//!if",
            "//!if A",
            "//!include gone",
            "//!endif",
        ] {
            let found = expanded(&[("main", text)], &[]);
            let is_bad = matches!(found, Err(ShaderError::BadLine { .. }));
            assert!(is_bad, "{text}: {found:?}");
        }
    }

    /// Every file stands alone or is included by one that does, in each way that its flags can be set.
    #[test]
    fn every_shader_is_valid() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        let listed: Vec<&str> = FILES.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, listed);
        let includes = |name: &str| {
            let line = format!("//!include \"{name}\"");
            FILES.iter().any(|(_, text)| text.contains(&line))
        };
        for (name, _) in FILES.iter().filter(|(name, _)| !includes(name)) {
            // (Always built with it.)
            let always: &[&[&str]] = match *name {
                "environment.wgsl" => &[&["OCCLUSION"], &["OCCLUSION", "HARMONIC_GLOSS"]],
                _ => &[&[]],
            };
            let flags = [
                &[][..],
                &["MULTISAMPLED"],
                &["ENCODED"],
                &["MULTISAMPLED", "ENCODED"],
                &["LOOKS"],
            ];
            for (flags, always) in flags
                .iter()
                .flat_map(|it| always.iter().map(move |a| (it, a)))
            {
                let flags: Vec<&str> = flags.iter().chain(*always).copied().collect();
                let text = source(name, &flags).unwrap();
                assert_eq!(error(name, &text), None, "{flags:?}");
            }
        }
    }

    #[test]
    fn a_broken_shader_is_caught() {
        let call = "fn f() -> f32 { return twice(1.0); }";
        let both = format!("fn twice(x: f32) -> f32 {{ return 2.0 * x; }}\n{call}");
        assert_eq!(error("pass.wgsl", &both), None);
        assert!(error("pass.wgsl", call).unwrap().contains("twice"));
        assert!(error("pass.wgsl", "fn f() -> f32 { return vec2f(1.0); }").is_some());
    }

    fn error(name: &str, text: &str) -> Option<String> {
        let module = match naga::front::wgsl::parse_str(text) {
            Ok(module) => module,
            Err(error) => return Some(error.emit_to_string_with_path(text, name)),
        };
        // Which of the optional capabilities the device has is the renderer's to ask for.
        let capabilities = naga::valid::Capabilities::all();
        let mut validator =
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
        let validated = validator.validate(&module);
        validated
            .err()
            .map(|error| error.emit_to_string_with_path(text, name))
    }
}
