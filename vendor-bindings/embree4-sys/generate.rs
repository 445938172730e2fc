//! Generates the bindings of a header with bindgen. The files in `src/bindings/` were generated with the same options.

use bindgen::{Builder, EnumVariation, Formatter, RustEdition, RustTarget};
use std::path::Path;

/// The bindings of `embree3/rtcore.h` or `embree4/rtcore.h`, in `include` or in the compiler's own directories.
pub(crate) fn bindings(include: Option<&Path>, family: u32, version: &str) -> Result<String, String> {
    let first_line = format!("// Made by bindgen from the headers of Embree {version}, see README.md. Do not edit.\n");
    // The oldest compiler with `unsafe extern`, so that the text does not depend on the compiler in use
    let target = RustTarget::stable(85, 0).map_err(|e| e.to_string())?;
    let builder = Builder::default()
        .header_contents("embree.h", &format!("#include <embree{family}/rtcore.h>\n"))
        .rust_edition(RustEdition::Edition2024)
        .rust_target(target)
        .formatter(Formatter::Prettyplease)
        .disable_header_comment()
        .raw_line(first_line)
        .generate_comments(false)
        .derive_default(true)
        .default_enum_style(EnumVariation::NewType { is_bitfield: false, is_global: false })
        .bitfield_enum("RTC.*Flags")
        .allowlist_recursively(true)
        .allowlist_function("rtc.*")
        .allowlist_type("RTC.*")
        .allowlist_var("RTC_.*")
        .blocklist_item("RTC_VERSION.*");
    let builder = include.iter().fold(builder, |b, include| b.clang_arg(format!("-I{}", include.display())));
    Ok(builder.generate().map_err(|e| format!("bindgen: {e}"))?.to_string())
}
