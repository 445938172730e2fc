//! A static page of results: text, tables, rows of images, colour scales, charts. Self-contained HTML and CSS; images
//! are separate files beside it.

use super::chart::Chart;
use super::images::Scale;
use minijinja::{Environment, Value, context};

/// A page: a title and blocks in order.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    blocks: Vec<Block>,
}

/// A part of a page.
#[derive(Clone, Debug)]
pub enum Block {
    /// A heading of the second rank, with an anchor.
    Section {
        /// Anchor.
        id: String,
        /// Heading.
        title: String,
    },
    /// A paragraph.
    Text(String),
    /// A remark in small print.
    Note(String),
    /// A table.
    Table(Table),
    /// Images side by side.
    Images(Vec<Shown>),
    /// The legend of the images above.
    Legend {
        /// Quantity and unit.
        title: String,
        /// Colours and their range.
        scale: Scale,
    },
    /// Names and values.
    Facts(Vec<(String, String)>),
    /// Curves.
    Chart(Chart),
}

/// An image with its caption.
#[derive(Clone, Debug)]
pub struct Shown {
    /// File beside the page.
    pub file: String,
    /// First line of the caption.
    pub title: String,
    /// The rest of it.
    pub caption: String,
}

/// Names of columns, and rows.
#[derive(Clone, Debug, Default)]
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<Cell>>,
}

/// One entry of a table.
#[derive(Clone, Debug)]
pub struct Cell {
    text: String,
    tone: Tone,
}

/// Style of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As text.
    Plain,
    /// A number, right-aligned.
    Number,
    /// A positive result.
    Good,
    /// A negative result.
    Bad,
}

impl Cell {
    /// Text.
    pub fn text(text: impl Into<String>) -> Self {
        Cell { text: text.into(), tone: Tone::Plain }
    }

    /// A number, as text.
    pub fn number(text: impl Into<String>) -> Self {
        Cell { text: text.into(), tone: Tone::Number }
    }

    /// A positive or negative result.
    pub fn verdict(good: bool, text: impl Into<String>) -> Self {
        Cell { text: text.into(), tone: if good { Tone::Good } else { Tone::Bad } }
    }
}

impl Table {
    /// A table without rows.
    pub fn new(header: &[&str]) -> Self {
        Table { header: header.iter().map(|&h| h.to_owned()).collect(), rows: Vec::new() }
    }

    /// Appends a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }
}

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");

impl Page {
    /// An empty page.
    pub fn new(title: impl Into<String>) -> Self {
        Page { title: title.into(), blocks: Vec::new() }
    }

    /// Appends a block.
    pub fn push(&mut self, block: Block) {
        self.blocks.push(block);
    }

    /// Appends blocks.
    pub fn extend(&mut self, blocks: impl IntoIterator<Item = Block>) {
        self.blocks.extend(blocks);
    }

    /// The page as HTML.
    pub fn html(&self) -> String {
        let blocks: Vec<Value> = self.blocks.iter().map(Block::context).collect();
        let page =
            context! { title => self.title.as_str(), style => Value::from_safe_string(STYLE.to_owned()), blocks };
        // The template engine escapes the values, since the name ends in html
        let html = Environment::new().render_named_str("page.html", TEMPLATE, page);
        html.expect("the template knows the blocks") + "\n"
    }
}

impl Block {
    /// A section's heading.
    pub fn section(id: &str, title: impl Into<String>) -> Self {
        Block::Section { id: id.to_owned(), title: title.into() }
    }

    /// The data of the block for the template.
    fn context(&self) -> Value {
        match self {
            // The key `kind` selects the branch of the template
            Block::Section { id, title } => context! { kind => "section", id => id.as_str(), title => title.as_str() },
            Block::Text(text) => context! { kind => "text", text => text.as_str() },
            Block::Note(text) => context! { kind => "note", text => text.as_str() },
            Block::Table(table) => context! { kind => "table", header => table.header.clone(), rows => table.rows() },
            Block::Images(list) => {
                let images: Vec<Value> = list.iter().map(Shown::context).collect();
                context! { kind => "images", images }
            }
            Block::Legend { title, scale } => {
                context! { kind => "legend", title => title.as_str(), background => scale.css(), ticks => scale.ticks(5) }
            }
            Block::Facts(list) => {
                let facts: Vec<Value> =
                    list.iter().map(|(k, v)| context! { name => k.as_str(), value => v.as_str() }).collect();
                context! { kind => "facts", facts }
            }
            Block::Chart(chart) => context! { kind => "chart", svg => Value::from_safe_string(chart.svg()) },
        }
    }
}

impl Shown {
    fn context(&self) -> Value {
        let Shown { file, title, caption } = self;
        context! { file => file.as_str(), title => title.as_str(), caption => caption.as_str() }
    }
}

impl Table {
    /// Rows of entries with their texts and classes.
    fn rows(&self) -> Vec<Value> {
        let entry = |cell: &Cell| {
            let class = match cell.tone {
                Tone::Plain => "",
                Tone::Number => "number",
                Tone::Good => "good",
                Tone::Bad => "bad",
            };
            context! { class, text => cell.text.as_str() }
        };
        self.rows.iter().map(|row| Value::from(row.iter().map(entry).collect::<Vec<Value>>())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::images::HEAT;

    #[test]
    fn what_a_text_holds_never_becomes_markup() {
        let evil = "<script>\"a\" & 'b'</script>";
        let mut page = Page::new(evil);
        let mut table = Table::new(&[evil]);
        table.row([Cell::text(evil), Cell::number(evil), Cell::verdict(true, evil)]);
        let shown = Shown { file: evil.into(), title: evil.into(), caption: evil.into() };
        page.extend([
            Block::Section { id: evil.into(), title: evil.into() },
            Block::Text(evil.into()),
            Block::Note(evil.into()),
            Block::Table(table),
            Block::Images(vec![shown]),
            Block::Facts(vec![(evil.into(), evil.into())]),
            Block::Legend { title: evil.into(), scale: Scale::new(HEAT, 1.0, 2.0) },
        ]);
        let html = page.html();
        assert!(!html.contains("<script") && !html.contains("'b'"));
        assert_eq!(html.matches("&lt;script&gt;&quot;a&quot; &amp; &#x27;b&#x27;&lt;&#x2f;script&gt;").count(), 18);
    }

    #[test]
    fn every_element_is_closed_and_nothing_comes_from_elsewhere() {
        // A page with tables, images and a chart
        let mut page = Page::new("t");
        let mut table = Table::new(&["a", "b"]);
        table.row([Cell::text("x"), Cell::number("1")]);
        table.row([Cell::text("y"), Cell::verdict(false, "no")]);
        let shown = |i: u32| Shown { file: format!("{i}.png"), title: "p".into(), caption: "c".into() };
        page.extend([
            Block::section("one", "One"),
            Block::Table(table),
            Block::Images((0..3).map(shown).collect()),
            Block::Chart(Chart::new("x", "y").with("s", vec![[1.0, 2.0], [10.0, 20.0]])),
        ]);

        // Every tag is closed, and there are no external resources
        let html = page.html();
        for name in ["html", "head", "body", "table", "tr", "td", "div", "figure", "h2", "svg", "a", "style"] {
            let open = html.matches(&format!("<{name}>")).count() + html.matches(&format!("<{name} ")).count();
            assert_eq!(open, html.matches(&format!("</{name}>")).count(), "{name}");
        }
        assert_eq!(html.matches("<tr>").count(), 3);
        assert!(!html.contains("http:") && !html.contains("https:") && !html.contains("url("));
    }
}
