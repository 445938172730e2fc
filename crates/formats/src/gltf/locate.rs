//! Maps a path in the JSON to bytes of the file, for messages.

use super::container::{Chunks, chunks};
use std::ops::Range;

/// Byte range of the value at a path, in the notation of errors; of its innermost existing parent if it does not exist;
/// the first byte of arrays and objects. The beginning of the file if the path is invalid.
pub fn locate(file: &[u8], place: &str) -> Range<usize> {
    if let Some(at) = place.strip_prefix("byte ").and_then(|at| at.parse::<usize>().ok()) {
        return at.min(file.len())..(at + 1).min(file.len());
    }
    let Some(Text { json, offset, root: mut at }) = text(file) else { return 0..0 };
    for part in place.split(['.', '[']).filter(|part| !part.is_empty()) {
        let next = match part.strip_suffix(']') {
            Some(index) => index.parse().ok().and_then(|index| item(json, at, index)),
            None => member(json, at, part),
        };
        let Some(next) = next else { break };
        at = next;
    }
    shifted(value_at(json, at), offset)
}

/// Byte ranges of a member of each element of an array of the root, as by [`locate`], in one pass over the file.
pub fn locate_members(file: &[u8], array: &str, key: &str) -> Vec<Range<usize>> {
    let Some(Text { json, offset, root }) = text(file) else { return Vec::new() };
    let first = member(json, root, array).and_then(|array| item(json, array, 0));
    let items = std::iter::successors(first, |&at| next(json, at));
    items.map(|at| shifted(value_at(json, member(json, at, key).unwrap_or(at)), offset)).collect()
}

/// The JSON of a file.
struct Text<'a> {
    json: &'a [u8],
    /// Its offset in the file.
    offset: usize,
    /// Offset of the root in the JSON.
    root: usize,
}

fn text(file: &[u8]) -> Option<Text<'_>> {
    let Chunks { json, .. } = chunks(file).ok()?;
    let offset = json.as_ptr() as usize - file.as_ptr() as usize;
    Some(Text { json, offset, root: skip_blanks(json, if json.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 }) })
}

/// Bytes of the value at `at`; the first byte of arrays and objects.
fn value_at(json: &[u8], at: usize) -> Range<usize> {
    let is_container = json.get(at).is_none_or(|b| b"{[".contains(b));
    let end = if is_container { at + 1 } else { skip_value(json, at) };
    at..end.min(json.len())
}

fn shifted(range: Range<usize>, offset: usize) -> Range<usize> {
    offset + range.start..offset + range.end
}

/// The value of a member of the object at `at`.
fn member(json: &[u8], at: usize, key: &str) -> Option<usize> {
    let mut at = skip_blanks(json, enter(json, at, b'{')?);
    while json.get(at) == Some(&b'"') {
        let end = skip_value(json, at);
        let colon = skip_blanks(json, end);
        let value = skip_blanks(json, (json.get(colon) == Some(&b':')).then_some(colon + 1)?);
        if json.get(at + 1..end.checked_sub(1)?) == Some(key.as_bytes()) {
            return Some(value);
        }
        at = next(json, value)?;
    }
    None
}

/// Element `index` of the array at `at`.
fn item(json: &[u8], at: usize, index: usize) -> Option<usize> {
    let mut at = skip_blanks(json, enter(json, at, b'[')?);
    for _ in 0..index {
        at = next(json, at)?;
    }
    json.get(at).filter(|&&b| b != b']').map(|_| at)
}

fn enter(json: &[u8], at: usize, bracket: u8) -> Option<usize> {
    (json.get(at) == Some(&bracket)).then_some(at + 1)
}

/// Offset after a value and its comma.
fn next(json: &[u8], value: usize) -> Option<usize> {
    let comma = skip_blanks(json, skip_value(json, value));
    (json.get(comma) == Some(&b',')).then(|| skip_blanks(json, comma + 1))
}

fn skip_blanks(json: &[u8], mut at: usize) -> usize {
    while json.get(at).is_some_and(u8::is_ascii_whitespace) {
        at += 1;
    }
    at
}

/// Offset after the value at `at`.
fn skip_value(json: &[u8], mut at: usize) -> usize {
    let mut depth = 0_usize;
    while let Some(&b) = json.get(at) {
        at += 1;
        match b {
            b'"' => {
                while let Some(&c) = json.get(at).filter(|&&c| c != b'"') {
                    at += if c == b'\\' { 2 } else { 1 };
                }
                at += 1;
            }
            b'{' | b'[' => depth += 1,
            b'}' | b']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let ends = json.get(at).is_none_or(|c| b",]}".contains(c) || c.is_ascii_whitespace());
        if depth == 0 && (ends || b"\"}]".contains(&b)) {
            break;
        }
    }
    at.min(json.len())
}

#[cfg(test)]
mod tests {
    use super::{locate, locate_members};

    #[test]
    fn places_are_found_and_what_is_not_there_is_where_it_would_be() {
        let json = br#" {"a": [1, {"b}\"": [], "c": "x,y", "d": -2.5e3}], "e": true}"#;
        let at = |place: &str| std::str::from_utf8(&json[locate(json, place)]).unwrap();
        assert_eq!((at("a[1].c"), at("a[1].d"), at("e"), at("a[0]")), ("\"x,y\"", "-2.5e3", "true", "1"));
        assert_eq!((at("a"), at(""), at("a[7]"), at("a[1].z")), ("[", "{", "[", "{"));
        assert_eq!(locate(json, "byte 5"), 5..6);
        for end in 0..json.len() {
            for place in ["a[1].d", "e.f.g", "a[0][0]", "byte 999", "[x]"] {
                assert!(locate(&json[..end], place).end <= end);
            }
        }
    }

    #[test]
    fn members_of_all_elements_are_where_each_alone_is() {
        let json =
            br#"{"a": 1, "images": [ {"uri": "a.png"}, {"name": "uri", "uri":"b,]}.png"} ,{"bufferView": 3}, 7]}"#;
        let found = locate_members(json, "images", "uri");
        let alone: Vec<_> = (0..4).map(|i| locate(json, &format!("images[{i}].uri"))).collect();
        assert_eq!(found, alone);
        assert!(locate_members(json, "meshes", "uri").is_empty());
        for end in 0..json.len() {
            assert!(locate_members(&json[..end], "images", "uri").iter().all(|range| range.end <= end));
        }
    }
}
