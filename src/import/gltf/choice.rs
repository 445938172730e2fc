//! Choices by name or by index.

use lumiris_formats::gltf::Place;
use lumiris_formats::names::nfc;

/// Names of the alternatives; the second names are used if no first name matches.
pub(super) type Names<'d> = Vec<[Option<&'d str>; 2]>;

/// The name of something in the file.
pub(super) fn name_of<'d>(place: &Place<'d>) -> Option<&'d str> {
    place.key("name").text()
}

/// The displayed names; empty strings for unnamed alternatives.
pub(super) fn shown(names: &Names<'_>) -> Vec<String> {
    names.iter().map(|[name, other]| name.or(*other).unwrap_or_default().to_owned()).collect()
}

/// The index of the alternative with the name `wanted`, or with the index `wanted` if no name matches. `what` and
/// `option` name the kind of choice and its option.
///
/// Returns `Err` with the list of alternatives if there is none.
pub(super) fn chosen([what, option]: [&str; 2], wanted: &str, names: &Names<'_>) -> Result<usize, String> {
    let is_wanted = |name: &str| nfc(name) == nfc(wanted);
    let called =
        |level: usize| (0..names.len()).filter(|&i| names[i][level].is_some_and(is_wanted)).collect::<Vec<_>>();
    let found = [called(0), called(1)].into_iter().find(|found| !found.is_empty()).unwrap_or_default();
    let index = || wanted.parse().ok().filter(|&i: &usize| i < names.len());
    let problem = match found[..] {
        [i] => return Ok(i),
        [] => match index() {
            Some(i) => return Ok(i),
            None => format!("there is no {what} `{wanted}`"),
        },
        _ => format!("{} of them are called `{wanted}`", found.len()),
    };
    let one = |(i, name): (usize, String)| if name.is_empty() { i.to_string() } else { format!("{i} ({name})") };
    let all: Vec<String> = shown(names).into_iter().enumerate().map(one).collect();
    let all = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
    Err(format!("{option}: {problem}; {what}s: {all}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_before_other_names_and_before_indices() {
        let names =
            vec![[Some("1"), Some("a")], [Some("a"), Some("b")], [None, Some("c")], [None, None], [None, Some("c")]];
        let of = |wanted: &str| chosen(["camera", "--camera"], wanted, &names);
        let accented = vec![[Some("gru\u{308}n"), None]];
        assert_eq!(chosen(["camera", "--camera"], "gr\u{fc}n", &accented), Ok(0));
        assert_eq!([of("1"), of("a"), of("b"), of("0"), of("3")], [Ok(0), Ok(1), Ok(1), Ok(0), Ok(3)]);
        let all = "cameras: 0 (1), 1 (a), 2 (c), 3, 4 (c)";
        assert_eq!(of("x"), Err(format!("--camera: there is no camera `x`; {all}")));
        assert_eq!(of("5"), Err(format!("--camera: there is no camera `5`; {all}")));
        assert_eq!(of("c"), Err(format!("--camera: 2 of them are called `c`; {all}")));
        assert_eq!(
            chosen(["scene", "--s"], "-1", &vec![]),
            Err("--s: there is no scene `-1`; scenes: none".to_owned())
        );
    }
}
