//! The HTML page of an image comparison ([`lumiris::imaging::compare`]). Its sources are in `viewer/`: `index.html`,
//! `style.css`, `images.js` (values and images) and `viewer.js` (controls).

mod page;

pub(crate) use page::{check_page, write_page};
