//! Textures: float and RGB functions of a surface point. All textures of a scene are stored in one [`TextureSet`].
//!
//! Textures are trees. Their nodes refer to earlier nodes by index, so no tree can contain itself. Roots that an
//! importer reserves are copies, to which no node refers. Semantics are pbrt-v4's. Checkerboards are point sampled: the
//! pixel integrates over their edges.
//!
//! * [`context`]: inputs of a lookup; [`mapping`]: texture coordinates; `procedural`: noise, marble, dots; [`udim`]:
//!   tiled images; [`texture`]: nodes of all kinds; [`texture_set`]: their values
//! * [`crate::imaging::mipmap`], [`crate::imaging::face_map`]: image lookups

pub mod context;
pub mod mapping;
mod procedural;
pub mod texture;
pub mod texture_set;
pub mod udim;

pub use crate::imaging::{Filter, Wrap};
pub use context::{FaceMapId, ImageId, TextureContext};
pub use mapping::{CheckerboardMapping, Mapping2d};
pub use procedural::{Bilerp, Dots, Marble, NoiseKind, NoiseTexture, Octaves};
pub use texture::{FaceTexture, FloatTexture, FloatTextureId, ImageTexture, RgbTexture, RgbTextureId};
pub use texture_set::TextureSet;
pub use udim::{Udim, UdimId};
