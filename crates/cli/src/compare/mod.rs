//! The page of a comparison of images ([`lumiris::imaging::compare`]); its parts are in `viewer/`: `index.html`,
//! `style.css`, `images.js` for values and images, `viewer.js` for controls.

mod page;

pub(crate) use page::{check_page, write_page};
