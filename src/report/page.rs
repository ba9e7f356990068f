//! The page itself: HTML with its style, the figures' JSON and Plotly's script, each once. A content
//! security policy in the page forbids it to load anything from anywhere.

use super::error::ReportError;
use super::{Item, Report, Section, Table, escape};
use plotly::Plot;
use plotly::configuration::{
    Configuration, DisplayModeBar, DoubleClick, ImageButtonFormats, ModeBarButtonName, ToImageButtonOptions,
};
use serde_json::{Map, Value};
use std::fmt::Write as _;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// `blob:` and `data:` are what saving a figure as an image needs; both stay within the page.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                      img-src data: blob:; font-src data:";

impl Report {
    /// The page as text. The same report gives the same text, byte for byte.
    pub fn to_html(&self) -> Result<String, ReportError> {
        let mut figures = Vec::new();
        let mut body = String::new();
        for section in &self.sections {
            write_section(&mut body, section, &mut figures)?;
        }
        let mut html = String::with_capacity(body.len() + (5 << 20));
        let title = escape::html(&self.title);
        let subtitle = escape::html(&self.subtitle);
        put(
            &mut html,
            format_args!("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"),
        );
        put(&mut html, format_args!("<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n"));
        put(
            &mut html,
            format_args!("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"),
        );
        put(&mut html, format_args!("<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n"));
        put(&mut html, format_args!("<header>\n<h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n"));
        if let Some(status) = &self.status {
            let (class, sign) = if status.good { ("good", '\u{2713}') } else { ("bad", '\u{2717}') };
            let text = escape::html(&status.text);
            put(&mut html, format_args!("<p class=\"status {class}\">{sign} {text}</p>\n"));
        }
        put(&mut html, format_args!("</header>\n<main>\n{body}</main>\n"));
        html.push_str(&footer(!figures.is_empty()));
        if !figures.is_empty() {
            let mut page = Map::new();
            page.insert("config".to_owned(), serde_json::to_value(configuration())?);
            page.insert("figures".to_owned(), Value::Array(figures));
            let json = escape::json_in_script(&serde_json::to_string(&page)?);
            put(
                &mut html,
                format_args!("<script type=\"application/json\" id=\"figure-data\">{json}</script>\n"),
            );
            put(&mut html, format_args!("{}\n<script>\n{SCRIPT}</script>\n", plotly_script()));
        }
        html.push_str("</body>\n</html>\n");
        Ok(html)
    }
}

/// Appends; writing to a String cannot fail.
fn put(html: &mut String, text: std::fmt::Arguments<'_>) {
    let _ = html.write_fmt(text);
}

fn write_section(html: &mut String, section: &Section, figures: &mut Vec<Value>) -> Result<(), ReportError> {
    put(html, format_args!("<section>\n<h2>{}</h2>\n", escape::html(&section.heading)));
    for paragraph in section.text.split("\n\n").filter(|p| !p.trim().is_empty()) {
        put(html, format_args!("<p>{}</p>\n", escape::html(paragraph.trim())));
    }
    for item in &section.items {
        match item {
            Item::Table(table) => write_table(html, table)?,
            Item::Figure(figure) => {
                let id = write_place(html, figures.len(), &figure.title, figure.height(), &figure.note);
                figures.push(with_id(figure.to_json()?, id));
            }
            Item::Graph(graph) => {
                let id = write_place(html, figures.len(), &graph.title, graph.height(), &graph.note);
                figures.push(with_id(graph.to_json()?, id));
            }
            Item::Tree(tree) => {
                let id = write_place(html, figures.len(), &tree.title, tree.height(), &tree.note);
                figures.push(with_id(tree.to_json()?, id));
            }
        }
    }
    html.push_str("</section>\n");
    Ok(())
}

/// Leaves room for a figure, so that nothing moves when it is drawn; gives the name of the place.
fn write_place(html: &mut String, before: usize, title: &str, height: usize, note: &str) -> String {
    let id = format!("figure-{}", before + 1);
    put(html, format_args!("<figure>\n<figcaption>{}</figcaption>\n", escape::html(title)));
    put(html, format_args!("<div class=\"plot\" id=\"{id}\" style=\"height:{height}px\"></div>\n"));
    if !note.is_empty() {
        put(html, format_args!("<p class=\"note\">{}</p>\n", escape::html(note)));
    }
    html.push_str("</figure>\n");
    id
}

fn with_id(mut figure: Map<String, Value>, id: String) -> Value {
    figure.insert("id".to_owned(), Value::String(id));
    Value::Object(figure)
}

fn write_table(html: &mut String, table: &Table) -> Result<(), ReportError> {
    for (k, row) in table.rows.iter().enumerate() {
        if row.len() != table.header.len() {
            return Err(ReportError::Length {
                place: format!("table `{}`, row {}", table.caption, k + 1),
                found: row.len(),
                expected: table.header.len(),
                reason: "one per column of the header",
            });
        }
    }
    // A column is set flush right when its cells are numbers, whatever else stands among them.
    let numeric = |c: usize| {
        let cells = || table.rows.iter().filter_map(|row| row.get(c));
        let number = |cell: &str| cell.parse::<f64>().is_ok();
        cells().any(|cell| number(cell))
    };
    let class = |c: usize| if numeric(c) { " class=\"number\"" } else { "" };
    put(html, format_args!("<div class=\"table\"><table>\n"));
    put(html, format_args!("<caption>{}</caption>\n<thead><tr>", escape::html(&table.caption)));
    for (c, cell) in table.header.iter().enumerate() {
        put(html, format_args!("<th scope=\"col\"{}>{}</th>", class(c), escape::html(cell)));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        html.push_str("<tr>");
        for (c, cell) in row.iter().enumerate() {
            put(html, format_args!("<td{}>{}</td>", class(c), escape::html(cell)));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody>\n</table></div>\n");
    Ok(())
}

fn footer(with_figures: bool) -> String {
    let help = if with_figures {
        "<noscript><p>The figures are drawn by the script in this page; allow it to see them.</p></noscript>\n\
         <p>In a figure: point to read values, drag to zoom, double-click to zoom out; click a name in the legend \
         to hide its line, double-click to see it alone. Long records are drawn through the smallest and largest \
         sample of each short interval; the whole record is in the trajectory file. This page loads nothing from \
         a network.</p>\n"
    } else {
        ""
    };
    format!("<footer>\n{help}<p>bess-consensus {}</p>\n</footer>\n", env!("CARGO_PKG_VERSION"))
}

/// Plotly's script element alone: what the crate offers holds MathJax after it, which no label here needs.
fn plotly_script() -> String {
    let scripts = Plot::offline_js_sources();
    let end = "</script>";
    scripts.split_once(end).map_or_else(String::new, |(plotly, _)| format!("{}{end}", plotly.trim_start()))
}

fn configuration() -> Configuration {
    Configuration::new()
        .responsive(true)
        .typeset_math(false)
        .display_mode_bar(DisplayModeBar::Hover)
        .display_logo(false)
        .double_click(DoubleClick::ResetAutoSize)
        .plotly_server_url("")
        .topojson_url("")
        .mode_bar_buttons_to_remove(vec![
            ModeBarButtonName::Select2d,
            ModeBarButtonName::Lasso2d,
            ModeBarButtonName::AutoScale2d,
        ])
        .to_image_button_options(ToImageButtonOptions::new().format(ImageButtonFormats::Svg))
}
