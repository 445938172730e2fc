//! A static page of results: text, tables, rows of pictures, colour scales, curves. HTML and CSS without anything from
//! elsewhere; pictures lie beside it.

use super::chart::Chart;
use super::pictures::Scale;
use std::fmt::Write;

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
    /// Pictures side by side.
    Pictures(Vec<Shown>),
    /// What the colours of pictures above mean.
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

/// A picture with its caption.
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

/// How an entry looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As text.
    Plain,
    /// A number: to the right.
    Number,
    /// Good news.
    Good,
    /// Bad news.
    Bad,
}

impl Cell {
    /// Text.
    pub fn text(text: impl Into<String>) -> Self {
        Cell { text: text.into(), tone: Tone::Plain }
    }

    /// A number, as it shall be written.
    pub fn number(text: impl Into<String>) -> Self {
        Cell { text: text.into(), tone: Tone::Number }
    }

    /// Yes or no.
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

/// The text with everything replaced that HTML would take for its own.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

const STYLE: &str = "\
body{font:15px/1.5 system-ui,sans-serif;color:#1c1c1e;background:#fff;margin:2rem auto;max-width:76rem;padding:0 1rem}\
h1{font-size:1.7rem;line-height:1.2}h2{margin-top:2.6rem;border-top:1px solid #ddd;padding-top:1.2rem;font-size:1.25rem}\
p{max-width:52rem}.note{font-size:.87rem;color:#555}\
.scroll{overflow-x:auto}table{border-collapse:collapse;margin:1rem 0;font-size:.92rem}\
th,td{padding:.32rem .7rem;border-bottom:1px solid #e4e4e7;text-align:left;vertical-align:top}th{background:#f4f4f5}\
td.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}\
td.good{color:#166534;font-weight:600}td.bad{color:#b42318;font-weight:600}\
.pictures{display:flex;flex-wrap:wrap;gap:1rem;margin:1rem 0}\
figure{margin:0;flex:0 1 23rem;min-width:12rem}figure img{width:100%;display:block;image-rendering:pixelated;background:#000}\
figcaption{font-size:.87rem;margin-top:.3rem}figcaption b{display:block}\
.legend{margin:.5rem 0 1.2rem;max-width:32rem;font-size:.85rem}.legend .bar{height:.9rem;border:1px solid #bbb}\
.legend .ticks{display:flex;justify-content:space-between;font-variant-numeric:tabular-nums}\
dl{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1rem;font-size:.92rem}dt{color:#555}\
dd{margin:0;overflow-wrap:anywhere}svg{max-width:100%;height:auto}";

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
        let title = escape(&self.title);
        let mut out = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>{title}</title>\n\
             <style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
        );
        self.blocks.iter().for_each(|b| b.write(&mut out));
        out + "</body>\n</html>\n"
    }
}

impl Block {
    /// A section's heading.
    pub fn section(id: &str, title: impl Into<String>) -> Self {
        Block::Section { id: id.to_owned(), title: title.into() }
    }

    fn write(&self, out: &mut String) {
        // Writing to a string cannot fail.
        let _ = match self {
            Block::Section { id, title } => writeln!(out, "<h2 id=\"{}\">{}</h2>", escape(id), escape(title)),
            Block::Text(text) => writeln!(out, "<p>{}</p>", escape(text)),
            Block::Note(text) => writeln!(out, "<p class=\"note\">{}</p>", escape(text)),
            Block::Table(table) => writeln!(out, "<div class=\"scroll\">{}</div>", table.html()),
            Block::Pictures(list) => writeln!(out, "<div class=\"pictures\">{}</div>", pictures(list)),
            Block::Legend { title, scale } => writeln!(out, "{}", legend(title, scale)),
            Block::Facts(list) => {
                let items = list.iter().map(|(k, v)| format!("<dt>{}</dt><dd>{}</dd>", escape(k), escape(v)));
                writeln!(out, "<dl>{}</dl>", items.collect::<String>())
            }
            Block::Chart(chart) => writeln!(out, "{}", chart.svg()),
        };
    }
}

impl Table {
    fn html(&self) -> String {
        let header: String = self.header.iter().map(|h| format!("<th>{}</th>", escape(h))).collect();
        let mut out = format!("<table><thead><tr>{header}</tr></thead><tbody>\n");
        for row in &self.rows {
            let cells = row.iter().map(|cell| {
                let class = match cell.tone {
                    Tone::Plain => "",
                    Tone::Number => " class=\"number\"",
                    Tone::Good => " class=\"good\"",
                    Tone::Bad => " class=\"bad\"",
                };
                format!("<td{class}>{}</td>", escape(&cell.text))
            });
            let _ = writeln!(out, "<tr>{}</tr>", cells.collect::<String>());
        }
        out + "</tbody></table>"
    }
}

fn pictures(list: &[Shown]) -> String {
    let figure = |s: &Shown| {
        let (file, title, caption) = (escape(&s.file), escape(&s.title), escape(&s.caption));
        format!(
            "<figure><a href=\"{file}\"><img src=\"{file}\" alt=\"{title}\"></a>\
             <figcaption><b>{title}</b>{caption}</figcaption></figure>\n"
        )
    };
    list.iter().map(figure).collect()
}

fn legend(title: &str, scale: &Scale) -> String {
    let ticks: String = scale.ticks(5).iter().map(|t| format!("<span>{}</span>", escape(t))).collect();
    format!(
        "<div class=\"legend\">{}<div class=\"bar\" style=\"background:{}\"></div><div class=\"ticks\">{ticks}</div></div>",
        escape(title),
        scale.css()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::pictures::HEAT;

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
            Block::Pictures(vec![shown]),
            Block::Facts(vec![(evil.into(), evil.into())]),
            Block::Legend { title: evil.into(), scale: Scale::new(HEAT, 1.0, 2.0) },
        ]);
        let html = page.html();
        assert!(!html.contains("<script") && !html.contains("'b'"));
        assert_eq!(html.matches("&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;&lt;/script&gt;").count(), 18);
    }

    #[test]
    fn every_element_is_closed_and_nothing_comes_from_elsewhere() {
        let mut page = Page::new("t");
        let mut table = Table::new(&["a", "b"]);
        table.row([Cell::text("x"), Cell::number("1")]);
        table.row([Cell::text("y"), Cell::verdict(false, "no")]);
        let shown = |i: u32| Shown { file: format!("{i}.png"), title: "p".into(), caption: "c".into() };
        page.extend([
            Block::section("one", "One"),
            Block::Table(table),
            Block::Pictures((0..3).map(shown).collect()),
            Block::Chart(Chart::new("x", "y").with("s", vec![[1.0, 2.0], [10.0, 20.0]])),
        ]);
        let html = page.html();
        for name in ["html", "head", "body", "table", "tr", "td", "div", "figure", "h2", "svg", "a", "style"] {
            let open = html.matches(&format!("<{name}>")).count() + html.matches(&format!("<{name} ")).count();
            assert_eq!(open, html.matches(&format!("</{name}>")).count(), "{name}");
        }
        assert_eq!(html.matches("<tr>").count(), 3);
        assert!(!html.contains("http:") && !html.contains("https:") && !html.contains("url("));
    }
}
