//! `lumiris generate island`

use crate::program::{command, read, stderr};

#[test]
fn a_generated_island_renders_without_warnings() {
    let folder = tempfile::tempdir().unwrap();
    let args = "generate island -o i --instances 2000 --detail 64 --resolution 32";
    let output = command(folder.path(), args).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("8192 triangles"), "{}", stderr(&output));
    for view in ["island", "beach"] {
        let args = format!("render i/{view}.pbrt --spp 1 --resolution 32x18 -q -o a.exr");
        let output = command(folder.path(), &args).output().unwrap();
        assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
        let image = read(folder.path(), "a.exr").image;
        let green = image.channel("G").unwrap();
        let lit = (0..32 * 18).filter(|i| image.get(i % 32, i / 32, green) > 0.01).count();
        assert!(lit > 32 * 18 / 2, "{view}: {lit} pixels are lit");
    }
}
