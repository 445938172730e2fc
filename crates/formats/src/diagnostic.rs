//! Errors and warnings of importers, with positions in the files they refer to.
//!
//! A run collects [`Diagnostic`]s in [`Diagnostics`]. At the end they become a [`Report`] of formatted text, which no
//! longer needs the sources. All files that cannot be opened are a single error.

use super::source::{Location, Position, SourceMap, Span};
use codespan_reporting::diagnostic as codespan;
use codespan_reporting::files::{Error as FilesError, Files};
use codespan_reporting::term;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

/// Maximum number of diagnostics of one severity in a report; the rest is counted.
const REPORT_LIMIT: usize = 100;
/// Maximum number of warnings of one kind in a report.
const KIND_LIMIT: usize = 5;
/// Maximum number of diagnostics in memory.
const KEEP_LIMIT: usize = 2000;
/// Maximum number of comparisons of unknown names with known ones per run, since a scene of 10⁵ materials may have as
/// many unknown names.
const COMPARISONS: usize = 200_000;

/// Severity of a diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The scene cannot be used.
    Error,
    /// The scene is used, but not as its author may expect.
    Warning,
}

/// A remark on a source position.
#[derive(Clone, Debug)]
pub struct Label {
    /// The position.
    pub span: Span,
    /// The remark; may be empty.
    pub message: String,
}

/// One error or warning.
#[derive(Clone, Debug)]
pub struct Diagnostic {
    /// Severity.
    pub severity: Severity,
    /// One sentence without a full stop.
    pub message: String,
    /// Positions; the first is the primary one.
    pub labels: Vec<Label>,
    /// A suggestion for the author.
    pub help: Option<String>,
}

impl Diagnostic {
    fn new(severity: Severity, span: Option<Span>, message: String) -> Self {
        let labels = span.map(|span| Label { span, message: String::new() }).into_iter().collect();
        Diagnostic { severity, message, labels, help: None }
    }

    /// Sets the remark at the primary position.
    pub fn remark(&mut self, message: impl Into<String>) -> &mut Self {
        if let Some(label) = self.labels.first_mut() {
            label.message = message.into();
        }
        self
    }

    /// Adds a second position.
    pub fn label(&mut self, span: Span, message: impl Into<String>) -> &mut Self {
        self.labels.push(Label { span, message: message.into() });
        self
    }

    /// Sets the help text.
    pub fn help(&mut self, help: impl Into<String>) -> &mut Self {
        self.help = Some(help.into());
        self
    }
}

/// A file that could not be opened, and the source position of its name.
#[derive(Clone, Debug)]
struct MissingFile {
    path: PathBuf,
    reason: String,
    span: Option<Span>,
}

/// Collects the diagnostics of a run, in order of discovery.
#[derive(Debug, Default)]
pub struct Diagnostics {
    list: Vec<Diagnostic>,
    missing: Vec<MissingFile>,
    /// Positions of each kind of warning, and the number of warnings of the kind that were only counted.
    kinds: BTreeMap<String, (BTreeSet<(u32, u32)>, usize)>,
    errors: usize,
    dropped: usize,
    overflow: Option<Box<Diagnostic>>,
    /// Number of comparisons of names so far.
    compared: usize,
}

impl Diagnostics {
    /// No diagnostics.
    pub fn new() -> Self {
        Diagnostics::default()
    }

    /// Adds an error at `span`.
    pub fn error(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.push(Severity::Error, Some(span), message.into())
    }

    /// Adds an error about a name that is not among the `known` ones, with the nearest of them as help.
    pub fn unknown<'a>(
        &mut self,
        span: Span,
        kind: &str,
        name: &str,
        known: impl ExactSizeIterator<Item = &'a str>,
    ) -> &mut Diagnostic {
        self.compared = self.compared.saturating_add(known.len());
        let near = if self.compared <= COMPARISONS { did_you_mean(name, known) } else { None };
        let diagnostic = self.error(span, format!("unknown {kind} `{name}`"));
        diagnostic.help = near.map(|near| format!("did you mean `{near}`?"));
        diagnostic
    }

    /// Adds an error without a position in a file, such as an error of an option.
    pub fn error_without_place(&mut self, message: impl Into<String>) -> &mut Diagnostic {
        self.push(Severity::Error, None, message.into())
    }

    /// Adds a warning without a position in a file.
    pub fn warning_without_place(&mut self, message: impl Into<String>) -> &mut Diagnostic {
        self.push(Severity::Warning, None, message.into())
    }

    /// Adds a warning at `span`.
    pub fn warning(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.push(Severity::Warning, Some(span), message.into())
    }

    /// Adds a warning unless the same message was given for the same position. A message with many positions is only
    /// recorded for the first few, and then counted. Returns the warning if it is recorded.
    pub fn warning_once(&mut self, span: Span, message: impl Into<String>) -> Option<&mut Diagnostic> {
        let message = message.into();
        let (places, more) = self.kinds.entry(message.clone()).or_default();
        if !places.insert((span.file, span.start)) {
            return None;
        }
        if places.len() > KIND_LIMIT {
            *more += 1;
            return None;
        }
        Some(self.push(Severity::Warning, Some(span), message))
    }

    /// Adds a warning if its message is new.
    pub fn warning_first(&mut self, span: Span, message: impl Into<String>) -> Option<&mut Diagnostic> {
        let message = message.into();
        if self.kinds.contains_key(&message) {
            return None;
        }
        self.kinds.insert(message.clone(), (BTreeSet::from([(span.file, span.start)]), 0));
        Some(self.push(Severity::Warning, Some(span), message))
    }

    /// Records a file that could not be opened; all such files become one error.
    pub fn missing_file(&mut self, path: impl Into<PathBuf>, reason: impl fmt::Display, span: Option<Span>) {
        self.missing.push(MissingFile { path: path.into(), reason: reason.to_string(), span });
    }

    /// True if there is an error.
    pub fn has_errors(&self) -> bool {
        self.errors > 0 || !self.missing.is_empty()
    }

    /// Number of errors and warnings so far.
    pub fn len(&self) -> usize {
        self.list.len() + self.dropped + usize::from(!self.missing.is_empty())
    }

    /// True if there are no diagnostics.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The finished texts: errors first, each severity in order of discovery.
    pub fn finish(mut self, sources: &SourceMap) -> Report {
        self.conclude_missing_files(sources);
        let mut report = Report { dropped: self.dropped, ..Report::default() };
        for severity in [Severity::Error, Severity::Warning] {
            let all = self.list.iter().filter(|d| d.severity == severity);
            let count = all.clone().count();
            report.entries.extend(all.take(REPORT_LIMIT).map(|d| entry(d, sources)));
            report.dropped += count.saturating_sub(REPORT_LIMIT);
        }
        report.errors = self.errors;
        for (message, (_, more)) in self.kinds.iter().filter(|(_, (_, more))| *more > 0) {
            report.repeated.push((message.clone(), *more));
        }
        report
    }

    fn push(&mut self, severity: Severity, span: Option<Span>, message: String) -> &mut Diagnostic {
        self.errors += usize::from(severity == Severity::Error);
        let diagnostic = Diagnostic::new(severity, span, message);
        if self.list.len() >= KEEP_LIMIT {
            self.dropped += 1;
            return self.overflow.insert(Box::new(diagnostic));
        }
        self.list.push(diagnostic);
        self.list.last_mut().expect("one was pushed")
    }

    fn conclude_missing_files(&mut self, sources: &SourceMap) {
        if self.missing.is_empty() {
            return;
        }
        let mut by_path: BTreeMap<PathBuf, (String, Vec<Span>)> = BTreeMap::new();
        for m in std::mem::take(&mut self.missing) {
            by_path.entry(m.path).or_insert_with(|| (m.reason, Vec::new())).1.extend(m.span);
        }
        let lines: Vec<String> = by_path
            .iter()
            .map(|(path, (reason, spans))| {
                let place = spans.first().map_or(String::new(), |&s| format!(", asked for at {}", sources.locate(s)));
                let more = match spans.len() {
                    0 | 1 => String::new(),
                    2 => " and one more place".to_owned(),
                    n => format!(" and {} more places", n - 1),
                };
                format!("{}: {reason}{place}{more}", path.display())
            })
            .collect();
        let first = by_path.values().find_map(|(_, spans)| spans.first().copied());
        let what = if lines.len() == 1 { "1 file".to_owned() } else { format!("{} files", lines.len()) };
        let diagnostic = self.push(Severity::Error, first, format!("{what} cannot be read"));
        diagnostic.help = Some(lines.join("\n"));
    }
}

/// A finished diagnostic.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Severity.
    pub severity: Severity,
    /// One sentence without a full stop.
    pub message: String,
    /// The primary position.
    pub location: Option<Location>,
    /// The whole text with source lines and help, ending in a newline.
    pub rendered: String,
}

/// The diagnostics of a run, as text.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Errors, then warnings.
    pub entries: Vec<Entry>,
    /// Number of errors, including those not in `entries`.
    pub errors: usize,
    /// Number of diagnostics that are not in `entries`.
    pub dropped: usize,
    /// Warnings with more positions than `entries` has: (message, number of further positions).
    pub repeated: Vec<(String, usize)>,
}

impl Report {
    /// The errors in `entries`.
    pub fn errors(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|e| e.severity == Severity::Error)
    }

    /// The warnings in `entries`.
    pub fn warnings(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|e| e.severity == Severity::Warning)
    }

    /// True if there are no diagnostics.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for e in &self.entries {
            f.write_str(&e.rendered)?;
        }
        for (message, more) in &self.repeated {
            writeln!(f, "warning: {message} (at {more} more places)")?;
        }
        if self.dropped > 0 {
            writeln!(f, "and {} more", self.dropped)?;
        }
        Ok(())
    }
}

impl std::error::Error for Report {}

fn entry(diagnostic: &Diagnostic, sources: &SourceMap) -> Entry {
    let mut excerpts = Excerpts::default();
    // Bytes of a binary file are not readable, and may control a terminal
    let (binary, text): (Vec<_>, Vec<_>) = diagnostic.labels.iter().partition(|l| sources.is_binary(l.span.file));
    let labels = text.into_iter().enumerate().map(|(i, label)| {
        let style = if i == 0 { codespan::LabelStyle::Primary } else { codespan::LabelStyle::Secondary };
        excerpts.add(sources, label.span, style).with_message(&label.message)
    });
    let labels: Vec<_> = labels.collect();
    let severity = match diagnostic.severity {
        Severity::Error => codespan::Severity::Error,
        Severity::Warning => codespan::Severity::Warning,
    };
    let mut text = codespan::Diagnostic::new(severity).with_message(&diagnostic.message).with_labels(labels);
    text = text.with_notes(binary.into_iter().map(|label| remark_on_binary(label, sources)).collect());
    if let Some(help) = &diagnostic.help {
        text = text.with_notes(vec![format!("help: {}", help.replace('\n', "\n      "))]);
    }
    let config = term::Config { chars: term::Chars::ascii(), ..term::Config::default() };
    let rendered = term::emit_into_string(&config, &excerpts, &text)
        .unwrap_or_else(|error| format!("{}: cannot be shown: {error}\n", diagnostic.message));
    // Remove trailing blanks of source lines.
    let mut rendered: String = rendered.trim_end().lines().flat_map(|line| [line.trim_end(), "\n"]).collect();
    rendered.push('\n');
    let location = diagnostic.labels.first().map(|l| sources.locate(l.span));
    Entry { severity: diagnostic.severity, message: diagnostic.message.clone(), location, rendered }
}

/// A remark on a position in a binary file.
fn remark_on_binary(label: &Label, sources: &SourceMap) -> String {
    let separator = if label.message.is_empty() { "" } else { ": " };
    format!("in {}{separator}{}", sources.locate(label.span), label.message)
}

/// Maximum number of characters of a source line on each side of the marked range.
const CONTEXT: usize = 100;

/// The part of a source line around a label, so that a line of megabytes is not printed.
struct Excerpt {
    name: String,
    text: String,
    line: usize,
    first_column: usize,
    /// Identity: file and start of the excerpt.
    key: (u32, usize),
}

#[derive(Default)]
struct Excerpts(Vec<Excerpt>);

impl Excerpts {
    /// Adds the excerpt of `span`. Returns a label of the marked range in it.
    fn add(&mut self, sources: &SourceMap, span: Span, style: codespan::LabelStyle) -> codespan::Label<usize> {
        let bytes = sources.bytes(span.file);
        let start = (span.start as usize).min(bytes.len());
        let line_start = bytes[..start].iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        let line_end = bytes[start..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| start + i);
        let end = (span.end as usize).clamp(start, line_end.max(start));
        let from = if start - line_start > CONTEXT { start - CONTEXT } else { line_start };
        let to = if line_end.saturating_sub(end) > CONTEXT { end.min(start + CONTEXT) + CONTEXT } else { line_end };
        let to = to.min(line_end);
        let before = clean(&bytes[from..start]);
        let marked = clean(&bytes[start..end.min(to)]);
        let range = before.len()..before.len() + marked.len();
        let key = (span.file, from);
        if let Some(id) = self.0.iter().position(|e| e.key == key && e.text.len() >= range.end) {
            return codespan::Label::new(style, id, range);
        }
        let location = sources.locate(Span { start: from as u32, ..span });
        let text = before + &marked + &clean(&bytes[end.min(to)..to]);
        let (line, first_column) = match location.position {
            Position::Text { line, column } => (line, column),
            Position::Byte(byte) => (1, byte),
        };
        self.0.push(Excerpt { name: location.name, text, line, first_column, key });
        codespan::Label::new(style, self.0.len() - 1, range)
    }
}

/// Single-line text: control characters and invalid UTF-8 become visible substitutes.
fn clean(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes)
        .chars()
        .map(|c| if c == '\t' { ' ' } else { c })
        .filter(|c| !c.is_control())
        .collect()
}

impl<'a> Files<'a> for Excerpts {
    type FileId = usize;
    type Name = &'a str;
    type Source = &'a str;

    fn name(&'a self, id: usize) -> Result<&'a str, FilesError> {
        self.0.get(id).map(|e| e.name.as_str()).ok_or(FilesError::FileMissing)
    }

    fn source(&'a self, id: usize) -> Result<&'a str, FilesError> {
        self.0.get(id).map(|e| e.text.as_str()).ok_or(FilesError::FileMissing)
    }

    fn line_index(&'a self, _: usize, _: usize) -> Result<usize, FilesError> {
        Ok(0)
    }

    fn line_number(&'a self, id: usize, _: usize) -> Result<usize, FilesError> {
        self.0.get(id).map(|e| e.line).ok_or(FilesError::FileMissing)
    }

    fn column_number(&'a self, id: usize, _: usize, byte: usize) -> Result<usize, FilesError> {
        let e = self.0.get(id).ok_or(FilesError::FileMissing)?;
        let before = e.text.get(..byte).unwrap_or(&e.text);
        Ok(e.first_column + before.chars().count())
    }

    fn line_range(&'a self, id: usize, line: usize) -> Result<Range<usize>, FilesError> {
        let e = self.0.get(id).ok_or(FilesError::FileMissing)?;
        if line > 0 {
            return Err(FilesError::LineTooLarge { given: line, max: 0 });
        }
        Ok(0..e.text.len())
    }
}

/// The nearest known word to `word`, if it is near enough to be a misspelling.
pub fn did_you_mean<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let near = |candidate: &&str| edit_distance(&word.to_lowercase(), &candidate.to_lowercase());
    let best = known.into_iter().min_by_key(near)?;
    (near(&best) <= 1 + word.chars().count().min(best.chars().count()) / 4).then_some(best)
}

/// The known parameter that `name` probably means: one that differs by a typing error; else the first with the same
/// last word, such as `roughness` of `specular_roughness`; else one that is still near.
pub fn similar_parameter<'a>(name: &str, known: impl Iterator<Item = &'a str> + Clone) -> Option<&'a str> {
    /// Minimum length of a significant word.
    const SHORTEST: usize = 3;
    let last_word = |name: &str| name.rsplit(['_', '.', '-']).next().unwrap_or_default().to_lowercase();
    let is_slip = |candidate: &&str| edit_distance(&name.to_lowercase(), &candidate.to_lowercase()) <= 2;
    let near = did_you_mean(name, known.clone());
    let word = last_word(name);
    let mut alike = known.filter(|candidate| word.len() >= SHORTEST && last_word(candidate) == word);
    near.filter(is_slip).or_else(|| alike.next()).or(near)
}

/// Number of insertions, deletions, replacements and transpositions from `a` to `b` [Damerau 1964].
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(64).collect(), b.chars().take(64).collect());
    let mut rows: Vec<Vec<usize>> = vec![(0..=b.len()).collect()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replace = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replace.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            row.push(best);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_for_what_was_meant_does_not_grow_with_errors_times_names() {
        let names: Vec<String> = (0..COMPARISONS / 4).map(|i| format!("{i}")).collect();
        let mut d = Diagnostics::new();
        for i in 0..5000 {
            d.unknown(Span::default(), "material", &format!("{i}x"), names.iter().map(String::as_str));
        }
        let helped = d.list.iter().filter(|diagnostic| diagnostic.help.is_some()).count();
        assert_eq!((helped, d.errors), (4, 5000));
    }

    #[test]
    fn a_report_shows_place_line_and_help() {
        let mut sources = SourceMap::new();
        let file = sources.add_text("a.pbrt", b"Film \"rgb\"\n  \"integer xresolutoin\" 5\n".to_vec());
        let mut diagnostics = Diagnostics::new();
        diagnostics
            .error(Span { file, start: 13, end: 34 }, "unknown parameter")
            .remark("not used")
            .help("did you mean");
        let report = diagnostics.finish(&sources);
        assert_eq!(report.entries[0].location.as_ref().unwrap().to_string(), "a.pbrt:2:3");
        let text = report.to_string();
        assert!(text.contains("a.pbrt:2:3"), "{text}");
        assert!(text.contains("\"integer xresolutoin\" 5"), "{text}");
        assert!(text.contains("help: did you mean"), "{text}");
    }

    #[test]
    fn long_lines_and_broken_text_are_shown_in_part() {
        let mut sources = SourceMap::new();
        let mut text = vec![b'1'; 1_000_000];
        text[500_000] = 0xff;
        text[500_001] = 0x07;
        let file = sources.add_text("long.pbrt", text);
        let mut diagnostics = Diagnostics::new();
        diagnostics.error(Span { file, start: 500_000, end: 500_002 }, "odd bytes");
        let text = diagnostics.finish(&sources).to_string();
        assert!(text.len() < 2000 && text.contains("long.pbrt:1:500001"), "{text}");
    }

    #[test]
    fn binary_files_are_named_by_their_bytes_and_not_shown() {
        let mut sources = SourceMap::new();
        let file = sources.add_text("a.glb", b"glTF\x02\0\0\0\x1b[2J\xff".to_vec());
        let mut diagnostics = Diagnostics::new();
        diagnostics.error(Span { file, start: 8, end: 9 }, "too short").remark("the length").help("copy it again");
        diagnostics.error_without_place("--environment: no light");
        diagnostics.missing_file("sky.hdr", "no such file", Some(Span { file, start: 4, end: 5 }));
        let text = diagnostics.finish(&sources).to_string();
        assert!(text.contains("in a.glb, byte 8: the length") && text.contains("help: copy it again"), "{text}");
        assert!(text.contains("sky.hdr: no such file, asked for at a.glb, byte 4"), "{text}");
        assert!(!text.contains("glTF") && !text.contains("[2J") && !text.contains("-->"), "{text}");
    }

    #[test]
    fn repeated_warnings_are_counted_and_missing_files_are_one_error() {
        let mut sources = SourceMap::new();
        let file = sources.add_text("a", vec![b' '; 100]);
        let mut diagnostics = Diagnostics::new();
        for start in 0..20 {
            diagnostics.warning_once(Span { file, start, end: start + 1 }, "curves are not rendered yet");
            diagnostics.warning_once(Span { file, start, end: start + 1 }, "curves are not rendered yet");
            diagnostics.missing_file(
                format!("mesh{}.ply", start % 2),
                "not found",
                Some(Span { file, start, end: start }),
            );
        }
        let report = diagnostics.finish(&sources);
        assert_eq!((report.entries.len(), report.errors, report.repeated[0].1), (6, 1, 15));
        let text = report.to_string();
        assert!(text.contains("mesh0.ply: not found, asked for at a:1:1 and 9 more places"), "{text}");
    }

    #[test]
    fn many_errors_are_capped() {
        let mut sources = SourceMap::new();
        let file = sources.add_text("a", vec![b' '; 10]);
        let mut diagnostics = Diagnostics::new();
        for _ in 0..5000 {
            diagnostics.error(Span { file, start: 0, end: 1 }, "bad").help("none");
        }
        let report = diagnostics.finish(&sources);
        assert_eq!((report.errors, report.entries.len(), report.dropped), (5000, 100, 4900));
    }

    #[test]
    fn suggestions_are_near() {
        assert_eq!(did_you_mean("xresolutoin", ["yresolution", "xresolution"]), Some("xresolution"));
        assert_eq!(did_you_mean("rufness", ["radius", "eta"]), None);
        assert_eq!(did_you_mean("Fov", ["fov"]), Some("fov"));
        let known = ["base_color", "specular_roughness", "specular_weight", "coat_roughness", "interface.eta"];
        let similar = |name| similar_parameter(name, known.into_iter());
        assert_eq!(
            similar("base_roughness"),
            Some("specular_roughness"),
            "though coat_roughness has more letters alike"
        );
        assert_eq!(similar("coat_rufness"), Some("coat_roughness"));
        assert_eq!((similar("roughness"), similar("eta")), (Some("specular_roughness"), Some("interface.eta")));
        assert_eq!(similar("metallic"), None);
    }
}
