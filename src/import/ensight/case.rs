//! The case file: which files there are, and at which times.

use super::geometry::shown;
use crate::error::{FileError, FileResult};
use crate::field::Association;
use std::path::Path;

/// The remedy for kinds of EnSight files that are not read.
pub(super) const AS_GOLD: &str =
    "save it as EnSight Gold in C binary with a file for each step, for example with ParaView";

/// Kinds of variables that are read: what the lines begin with, where the values are, and the number of components.
const KINDS: &[(&str, Association, usize)] = &[
    ("scalar per node", Association::Point, 1),
    ("vector per node", Association::Point, 3),
    ("tensor symm per node", Association::Point, 6),
    ("scalar per element", Association::Cell, 1),
    ("vector per element", Association::Cell, 3),
    ("tensor symm per element", Association::Cell, 6),
];

/// Names of a file at each step: one name, or a pattern with asterisks for the number of the step.
#[derive(Debug)]
pub(super) struct Named {
    pub(super) set: Option<u64>,
    pub(super) pattern: String,
}

/// A variable of a kind that is read.
#[derive(Debug)]
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) association: Association,
    pub(super) components: usize,
    pub(super) file: Named,
}

/// Times, and the numbers in the names of their files.
#[derive(Debug, Default)]
pub(super) struct TimeSet {
    pub(super) number: u64,
    pub(super) steps: Option<u64>,
    pub(super) start: Option<u64>,
    pub(super) increment: Option<u64>,
    pub(super) numbers: Vec<u64>,
    pub(super) values: Vec<f64>,
}

/// What a case file says.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub(super) model: Option<Named>,
    pub(super) variables: Vec<Variable>,
    pub(super) sets: Vec<TimeSet>,
    /// Variables that are not read, as `'NAME' (REASON)`.
    pub(super) left_out: Vec<String>,
    /// Other lines that are not read.
    pub(super) notes: Vec<String>,
    is_gold: bool,
}

/// The list of a time set that goes on in the next lines.
#[derive(Clone, Copy)]
enum List {
    Values,
    Numbers,
}

/// Reads the lines of a case file one by one.
struct Parser<'a> {
    path: &'a Path,
    line: usize,
    section: &'a str,
    list: Option<List>,
    contents: Contents,
}

/// Reads a case file.
///
/// # Errors
/// If it is of another format than EnSight Gold, has several steps in a file, or lines that contradict the format.
pub(super) fn parse(path: &Path, text: &str) -> FileResult<Contents> {
    let mut parser = Parser { path, line: 0, section: "", list: None, contents: Contents::default() };
    for line in text.lines() {
        parser.line += 1;
        let line = line.trim();
        if !line.is_empty() && !line.starts_with('#') {
            parser.read(line)?;
        }
    }
    if !parser.contents.is_gold {
        return Err(
            FileError::invalid(path, "", "has no line 'type: ensight gold' in a section FORMAT").remedy(AS_GOLD)
        );
    }
    Ok(parser.contents)
}

impl<'a> Parser<'a> {
    fn invalid(&self, problem: String) -> FileError {
        FileError::invalid(self.path, format!("line {}", self.line), problem)
    }

    fn unsupported(&self, problem: String) -> FileError {
        FileError::unsupported(self.path, format!("line {}", self.line), problem).remedy(AS_GOLD)
    }

    fn read(&mut self, line: &'a str) -> FileResult<()> {
        let is_section = line.bytes().all(|byte| byte.is_ascii_uppercase() || byte == b'_');
        if is_section {
            (self.section, self.list) = (line, None);
            if line == "FILE" {
                return Err(
                    self.unsupported("has files of several steps each (section FILE), which are not read".to_owned())
                );
            }
            return Ok(());
        }
        let (key, rest) = line.split_once(':').map_or(("", line), |(key, rest)| (key.trim(), rest.trim()));
        let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase();
        match self.section {
            "FORMAT" => self.format(&key, rest),
            "GEOMETRY" => self.geometry(&key, rest),
            "VARIABLE" => self.variable(&key, rest),
            "TIME" => self.time(&key, rest),
            "" => Err(self.invalid("stands before any section: this is no case file of EnSight".to_owned())),
            section => {
                let note = format!("passed over section {section} of the case file");
                if !self.contents.notes.contains(&note) {
                    self.contents.notes.push(note);
                }
                Ok(())
            }
        }
    }

    fn format(&mut self, key: &str, rest: &str) -> FileResult<()> {
        if key != "type" {
            return Ok(());
        }
        let kind = rest.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase();
        if kind != "ensight gold" {
            return Err(self.unsupported(format!("is of type '{kind}'; EnSight Gold alone is read")));
        }
        self.contents.is_gold = true;
        Ok(())
    }

    fn geometry(&mut self, key: &str, rest: &str) -> FileResult<()> {
        if key != "model" {
            self.contents.notes.push(format!("left out the geometry '{key}' of the case file"));
            return Ok(());
        }
        let (set, words) = self.numbered(words(rest), 1)?;
        let Some(pattern) = words.first().cloned() else { return Err(self.invalid("names no file".to_owned())) };
        if words.iter().any(|word| word == "change_coords_only") {
            self.contents.notes.push("the case file says that points move".to_owned());
        }
        self.contents.model = Some(Named { set, pattern });
        Ok(())
    }

    fn variable(&mut self, key: &str, rest: &str) -> FileResult<()> {
        let Some(&(_, association, components)) = KINDS.iter().find(|(kind, ..)| *kind == key) else {
            let words = words(rest);
            let name = words.iter().find(|word| word.parse::<u64>().is_err()).map_or("", String::as_str);
            self.contents.left_out.push(format!("'{name}' ({key})"));
            return Ok(());
        };
        let (set, words) = self.numbered(words(rest), 2)?;
        let [name, pattern] = &words[..] else {
            return Err(self.invalid(format!("'{key}' wants a name and a file, and has '{rest}'")));
        };
        let file = Named { set, pattern: pattern.clone() };
        self.contents.variables.push(Variable { name: name.clone(), association, components, file });
        Ok(())
    }

    /// The number of the time set before at least `least` words, and the words behind it.
    fn numbered(&self, words: Vec<String>, least: usize) -> FileResult<(Option<u64>, Vec<String>)> {
        let numbers: Vec<u64> = words.iter().map_while(|word| word.parse().ok()).collect();
        let count = numbers.len().min(words.len().saturating_sub(least));
        if count > 1 {
            return Err(self.unsupported("names a file set: files of several steps each are not read".to_owned()));
        }
        Ok((numbers.first().copied().filter(|_| count == 1), words.into_iter().skip(count).collect()))
    }

    fn time(&mut self, key: &str, rest: &str) -> FileResult<()> {
        if key.is_empty() {
            let Some(list) = self.list else {
                return Err(self.invalid(format!("'{}' follows no list", shown(rest))));
            };
            return self.append(list, rest);
        }
        self.list = None;
        if key == "time set" {
            let number = self.number(rest)?;
            if self.contents.sets.iter().any(|set| set.number == number) {
                return Err(self.invalid(format!("is a second time set {number}")));
            }
            self.contents.sets.push(TimeSet { number, ..TimeSet::default() });
            return Ok(());
        }
        match key {
            "number of steps" => {
                let steps = self.number(rest)?;
                self.set()?.steps = Some(steps);
            }
            "filename start number" => {
                let start = self.number(rest)?;
                self.set()?.start = Some(start);
            }
            "filename increment" => {
                let increment = self.number(rest)?;
                self.set()?.increment = Some(increment);
            }
            "time values" => return self.append(List::Values, rest),
            "filename numbers" => return self.append(List::Numbers, rest),
            "time values file" | "filename numbers file" => {
                let problem = format!("has its '{key}', which is not read");
                return Err(self.unsupported(problem).remedy("write these numbers into the case file"));
            }
            _ => {}
        }
        Ok(())
    }

    /// The time set that the lines are of.
    fn set(&mut self) -> FileResult<&mut TimeSet> {
        let error = self.invalid("stands before any 'time set'".to_owned());
        self.contents.sets.last_mut().ok_or(error)
    }

    /// The first word as a number that counts something.
    fn number(&self, rest: &str) -> FileResult<u64> {
        let word = rest.split_whitespace().next().unwrap_or("");
        word.parse().map_err(|_| self.invalid(format!("'{}' is no number from 0 on", shown(word))))
    }

    fn append(&mut self, list: List, rest: &str) -> FileResult<()> {
        self.list = Some(list);
        for word in rest.split_whitespace() {
            let error = self.invalid(format!("'{}' is no number of the list", shown(word)));
            let set = self.set()?;
            match list {
                List::Values => set.values.push(word.parse().map_err(|_| error)?),
                List::Numbers => set.numbers.push(word.parse().map_err(|_| error)?),
            }
        }
        Ok(())
    }
}

/// Words between blanks; a name in quotes is one.
fn words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (i, part) in text.split('"').enumerate() {
        if i % 2 == 1 {
            words.push(part.to_owned());
        } else {
            words.extend(part.split_whitespace().map(str::to_owned));
        }
    }
    words
}
