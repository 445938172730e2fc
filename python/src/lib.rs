//! The native part of the Python module `lumiris`. `python/lumiris` wraps it with names, documentation and types.
//!
//! Numbers cross the boundary in NumPy arrays. Results of Rust become arrays without a copy: the array owns the memory.
//! Long computations run without the GIL.
//!
//! Reading order: `settings` (keyword arguments), `images` (arrays and files), `render` and its callback (`attendant`,
//! `progress`), `parts`, `compare`, `denoise`, `estimators`.
#![cfg(feature = "module")]

mod attendant;
mod compare;
mod denoise;
mod estimators;
mod images;
mod parts;
mod progress;
mod render;
mod settings;

use lumiris::huge_pages::HugePages;
use pyo3::prelude::*;

#[global_allocator]
static MEMORY: HugePages = HugePages;

/// The native module.
#[pymodule]
fn _lumiris(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("SceneError", module.py().get_type::<render::SceneError>())?;
    module.add_class::<progress::PassProgress>()?;
    module.add_function(wrap_pyfunction!(settings::settings, module)?)?;
    module.add_function(wrap_pyfunction!(images::read, module)?)?;
    module.add_function(wrap_pyfunction!(images::write, module)?)?;
    module.add_function(wrap_pyfunction!(render::render, module)?)?;
    module.add_function(wrap_pyfunction!(parts::merge, module)?)?;
    module.add_function(wrap_pyfunction!(compare::compare, module)?)?;
    module.add_function(wrap_pyfunction!(denoise::denoise, module)?)?;
    module.add_function(wrap_pyfunction!(estimators::mis, module)?)?;
    module.add_function(wrap_pyfunction!(estimators::ris_draws, module)?)?;
    module.add_function(wrap_pyfunction!(estimators::ocv, module)?)?;
    module.add_function(wrap_pyfunction!(estimators::optimal_mis, module)?)
}
