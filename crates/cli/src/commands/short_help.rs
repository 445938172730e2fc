//! The options of `render` that `-h` lists, with the examples of `--help`.

use clap::Arg;

/// Names and examples of the options, in addition to `-h` itself.
const OPTIONS: [(&str, &str); 23] = [
    ("output", "-o picture.png -o picture.exr"),
    ("quiet", "-q"),
    ("threads", "--threads 8"),
    ("resolution", "--resolution 1920x1080"),
    ("crop", "--crop 0.25,0.75,0,0.5"),
    ("camera", "--camera 1"),
    ("environment", "--environment sky.exr"),
    ("frames", "shot.####.pbrt --frames 1-48 -o frame.####.exr"),
    ("time", "--time 600"),
    ("aov", "--aov albedo,normal,depth"),
    ("integrator", "--integrator direct"),
    ("max-depth", "--max-depth 8"),
    ("spp", "--spp 256"),
    ("noise", "--noise 2%"),
    ("seed", "--seed 7"),
    ("estimator", "--estimator ris"),
    ("samples", "--estimator mis --samples 4"),
    ("exposure", "--exposure -1.5"),
    ("view-transform", "--view-transform agx"),
    ("denoise", "--denoise -o picture.exr"),
    ("view", "--view=0.0.0.0:8080"),
    ("checkpoint", "--checkpoint kitchen.part,300"),
    ("resume", "--resume kitchen.part"),
];

/// Adds the example to an option of `-h`, and hides all other options from it.
pub(super) fn with_example(option: Arg) -> Arg {
    let of_option = option.get_long().map(|name| OPTIONS.iter().find(|(listed, _)| *listed == name));
    match of_option {
        Some(Some((_, example))) => {
            let help = option.get_long_help().or(option.get_help()).map(ToString::to_string).unwrap_or_default();
            option.long_help(format!("{help}\n\nExample: {example}"))
        }
        Some(None) => option.hide_short_help(true),
        None => option,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::cli::Cli;
    use clap::{CommandFactory, Parser};

    #[test]
    fn examples_are_valid_and_belong_to_the_options_of_the_short_help() {
        let mut command = Cli::command();
        let render = command.find_subcommand_mut("render").unwrap();
        let long = render.render_long_help().to_string();
        for (name, example) in OPTIONS {
            let option = render.get_arguments().find(|option| option.get_long() == Some(name)).unwrap();
            let forms = [Some(format!("--{name}")), option.get_short().map(|letter| format!("-{letter}"))];
            let has_it = example.split([' ', '=']).any(|word| forms.iter().flatten().any(|form| form == word));
            assert!(has_it && !option.is_hide_short_help_set(), "{example}");
            let scene = (!example.contains(".pbrt")).then_some("scene.pbrt");
            let words = ["lumiris", "render"].into_iter().chain(scene).chain(example.split(' '));
            Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{example}: {error}"));
            assert!(long.contains(&format!("Example: {example}")), "{example}");
        }
        let listed = render.get_arguments().filter(|option| option.get_long().is_some_and(|name| name != "help"));
        assert_eq!(listed.filter(|option| !option.is_hide_short_help_set()).count(), OPTIONS.len());
    }
}
