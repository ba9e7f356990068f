//! The page as a whole: a sample of everything that it can show, held against what a browser would do
//! with it. Leaves the sample in cargo's tmpdir for `tests/browser/check_report.py` and for people.
#![cfg(feature = "host")]
// The helpers below serve tests only.
#![allow(clippy::unwrap_used, clippy::panic)]

use bess_consensus::report::{
    Agents, Branch, Columns, Edge, Figure, GraphFigure, Item, Node, PhaseOptions, Report, Section, Status,
    Table, TreeFigure, cluster_layout, error_systems, five_states, phase_table, phases,
};
use serde_json::Value;
use std::path::{Path, PathBuf};

const K_P: [f64; 7] = [0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044];
const K_Q: [f64; 7] = [0.02, 0.0242, 0.026, 0.0246, 0.019, 0.0212, 0.0226];
/// Deviations before consensus, of sum 0.
const SPREAD: [f64; 7] = [1.5, -1.0, 0.5, -1.5, 1.0, -0.5, 0.0];

/// abs(e) under de/dt = -c sgn(e) abs(e)^0.5 (the paper's law for one error, eta = 0.5), in closed form.
fn finite_time(e0: f64, c: f64, t: f64) -> f64 {
    (e0.abs().sqrt() - 0.5 * c * t.max(0.0)).max(0.0).powi(2).copysign(e0)
}

fn events() -> Vec<(f64, String)> {
    vec![
        (20.0, "controller on".to_owned()),
        (50.0, "load \u{2212}(0.5+0.5j)".to_owned()),
        (80.0, "load +(1+1j)".to_owned()),
    ]
}

/// Looks like the paper's Case 1: 120 s in steps of 10 ms, seven BESS.
fn record() -> (Vec<f64>, Vec<(String, Vec<f64>)>) {
    let time: Vec<f64> = (0..=12_000).map(|k| f64::from(k) * 0.01).collect();
    let since = |t: f64| [80.0, 50.0, 20.0].into_iter().find(|&e| t >= e);
    let load = |t: f64| 12.0 - if t >= 50.0 { 0.5 } else { 0.0 } + if t >= 80.0 { 1.0 } else { 0.0 };
    let share: f64 = K_P.iter().map(|k| 1.0 / k).sum();
    let q_share: f64 = K_Q.iter().map(|k| 1.0 / k).sum();
    let mut data = Vec::new();
    for i in 0..7 {
        let kick = |t: f64, scale: f64, c: f64| match since(t) {
            None => scale * SPREAD[i],
            Some(20.0) => finite_time(scale * SPREAD[i], c, t - 20.0),
            Some(e) => finite_time(0.4 * scale * SPREAD[6 - i], c, t - e),
        };
        let dip = |t: f64| match since(t) {
            None => -0.0063,
            Some(20.0) => finite_time(-0.0063, 0.05, t - 20.0),
            Some(50.0) => finite_time(0.0008, 0.05, t - 50.0),
            Some(_) => finite_time(-0.0016, 0.05, t - 80.0),
        };
        let column = |f: &dyn Fn(f64) -> f64| time.iter().map(|&t| f(t)).collect::<Vec<f64>>();
        let p = |t: f64| load(t) / share / K_P[i] + kick(t, 1e-3, 0.03) / K_P[i];
        data.push((format!("grid.omega[{}]", i + 1), column(&|t| 1.0 + dip(t) + kick(t, 4e-4, 0.03))));
        data.push((format!("grid.P[{}]", i + 1), column(&p)));
        let drain = |t: f64| 0.5 / K_P[i] * (0.7 + kick(t, 2e-3, 0.0025)) / 100.0 - p(20.0) * t / 3600.0;
        data.push((format!("grid.E[{}]", i + 1), column(&drain)));
        data.push((format!("grid.V[{}]", i + 1), column(&|t| 1.0 + 3.0 * dip(t) + kick(t, 4e-3, 0.06))));
        let q = |t: f64| (0.25 * load(t) / q_share + kick(t, 5e-3, 0.05)) / K_Q[i];
        data.push((format!("grid.Q[{}]", i + 1), column(&q)));
    }
    data.push((
        "controller.T_omega".to_owned(),
        time.iter().map(|&t| if t < 20.0 { 7.1 } else { 4.2 }).collect(),
    ));
    data.push(("controller.T_P".to_owned(), time.iter().map(|_| 4.61).collect()));
    (time, data)
}

fn topology(title: &str, ring: bool) -> GraphFigure {
    let groups = [0, 0, 0, 1, 1, 1, 1];
    let leaders = [false, false, true, true, false, false, false];
    let buses = [1, 2, 3, 6, 8, 9, 12];
    let places = cluster_layout(&groups, &leaders);
    let nodes = (0..7)
        .map(|i| Node {
            name: format!("BESS {} (bus {})", i + 1, buses[i]),
            x: places[i].0,
            y: places[i].1,
            group: groups[i],
            is_leader: leaders[i],
        })
        .collect();
    let mut edges: Vec<Edge> =
        [(0, 1, 1.0), (1, 2, 0.43), (3, 4, 0.38), (4, 5, 0.71), (5, 6, 0.35), (2, 3, 0.22)]
            .map(|(a, b, weight)| Edge { a, b, weight })
            .to_vec();
    if ring {
        edges.extend([Edge { a: 0, b: 2, weight: 0.31 }, Edge { a: 3, b: 6, weight: 0.29 }]);
    }
    GraphFigure {
        title: title.to_owned(),
        nodes,
        edges,
        pins: vec![2, 3],
        note: "Squares: active leaders; star: the virtual leader, dashed to the agents pinned to it. Numbers and \
               thickness: weights w_ij. Shaded: clusters."
            .to_owned(),
    }
}

/// The tree behind the topology: one edge was cut, and one more weighed.
fn tree(title: &str) -> TreeFigure {
    let graph = topology(title, false);
    let branch = |edge: &Edge| {
        let is_cut = (edge.a, edge.b) == (2, 3);
        Branch {
            a: edge.a,
            b: edge.b,
            length: 0.05 / edge.weight,
            gain: (is_cut || edge.b == 6).then_some(if is_cut { 0.031 } else { 0.004 }),
            is_cut,
            verdict: if is_cut { "cut" } else { "kept" }.to_owned(),
        }
    };
    TreeFigure {
        title: title.to_owned(),
        branches: graph.edges.iter().map(branch).collect(),
        nodes: graph.nodes,
        note: graph.note,
    }
}

fn sample() -> Report {
    let (time, data) = record();
    let columns = Columns::new(&time, data.iter().map(|(name, y)| (name.as_str(), y.as_slice()))).unwrap();
    let mut agents = Agents::numbered(&K_P, &K_Q);
    agents.capacity = K_P.iter().map(|k| 0.5 / k / 100.0).collect();
    let options = PhaseOptions { active_from_s: 20.0, ..PhaseOptions::default() };
    let all = phases(&columns, &agents, &events(), &options).unwrap();
    let states = five_states(&columns, &agents, &events()).unwrap();
    let errors = error_systems(&columns, &agents, &events()).unwrap();
    Report {
        title: "Case 1: islanded operation".to_owned(),
        subtitle:
            "Seven BESS in the modified IEEE 57-bus system; the controller starts at 20 s, the load falls by \
                   0.5+0.5j pu at 50 s and rises by 1+1j pu at 80 s. (Synthetic sample data.)"
                .to_owned(),
        status: Some(Status { good: true, text: "Settled after every event".to_owned() }),
        sections: vec![
            Section {
                heading: "Figures by phase".to_owned(),
                text: String::new(),
                items: vec![phase_table(&all, &agents, &options)],
            },
            Section {
                heading: "States of the BESS".to_owned(),
                text: "The five states of every BESS, as the paper's Figure 6 shows them.".to_owned(),
                items: states.into_iter().map(Item::Figure).collect(),
            },
            Section {
                heading: "Error systems".to_owned(),
                text: "How fast frequency and active power sharing close in, as the paper's Figure 7."
                    .to_owned(),
                items: errors.into_iter().map(Item::Figure).collect(),
            },
            Section {
                heading: "Communication".to_owned(),
                text: String::new(),
                items: vec![
                    Item::Tree(tree("Spanning tree")),
                    Item::Graph(topology("Topology a3", false)),
                    Item::Graph(topology("Topology b3", true)),
                ],
            },
        ],
    }
}

fn temporary(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// What stands between two marks, first occurrence.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let start = text.find(from).unwrap_or_else(|| panic!("no {from}")) + from.len();
    &text[start..start + text[start..].find(to).unwrap_or_else(|| panic!("no {to} after {from}"))]
}

fn figure_data(html: &str) -> Value {
    serde_json::from_str(between(html, "id=\"figure-data\">", "</script>")).unwrap()
}

/// The page without Plotly's own code, which names addresses in plenty and loads none of them.
fn own_part(html: &str) -> String {
    let plotly = format!(
        "<script type=\"text/javascript\">{}</script>",
        between(html, "text/javascript\">", "</script>")
    );
    html.replace(&plotly, "")
}

#[test]
fn the_sample_is_whole_and_loads_nothing() {
    let path = temporary("report_sample.html");
    let html = sample().to_html().unwrap();
    std::fs::write(&path, &html).unwrap();
    let own = own_part(&html);
    for forbidden in
        ["http:", "https:", "//cdn", "src=", "href=", "@import", "url(", "MathJax", "<link", "<iframe"]
    {
        assert!(!own.contains(forbidden), "the page contains {forbidden}");
    }
    assert!(own.contains("default-src 'none'"));
    // Plotly once, and not MathJax, whose own code names its element.
    assert_eq!(html.matches("plotly.js v").count(), 1);
    assert!(!html.contains("mjx-container"));
    assert_eq!(html.matches("<script").count(), 3);
    assert!(html.len() < 6_500_000, "{} bytes", html.len());
    let data = figure_data(&html);
    let figures = data["figures"].as_array().unwrap();
    assert_eq!(figures.len(), 10);
    for figure in &figures[..7] {
        assert_eq!(figure["data"].as_array().unwrap().len(), 7);
        assert_eq!(figure["layout"]["shapes"].as_array().unwrap().len(), 3);
        let x = figure["x"].as_array().unwrap();
        assert!(x.len() <= 2000 && x[0] == 0.0 && x[x.len() - 1] == 120.0);
    }
    let color = |f: usize, i: usize| figures[f]["data"][i]["line"]["color"].as_str().unwrap().to_owned();
    for i in 0..7 {
        assert!((1..7).all(|f| color(f, i) == color(0, i)));
    }
    assert_eq!(own.matches("<tr>").count(), 5);
}

/// The drawing against the data it was made of: each edge of the tree once, cut ones dashed and with their gain,
/// each agent at its place, with its cluster's colour.
#[test]
fn the_tree_shows_every_edge_with_its_verdict_and_every_agent_in_its_clusters_colour() {
    let html = sample().to_html().unwrap();
    let data = figure_data(&html);
    let drawn = data["figures"].as_array().unwrap().iter().find(|f| f["id"] == "figure-8").unwrap();
    let traces = drawn["data"].as_array().unwrap();
    let given = tree("");
    let strokes: Vec<&Value> = traces.iter().filter(|t| t["mode"] == "lines").collect();
    assert_eq!(strokes.len(), given.branches.len());
    for branch in &given.branches {
        let x = serde_json::json!([given.nodes[branch.a].x, given.nodes[branch.b].x]);
        let y = serde_json::json!([given.nodes[branch.a].y, given.nodes[branch.b].y]);
        let stroke = strokes.iter().find(|t| t["x"] == x && t["y"] == y).unwrap();
        assert_eq!(stroke["line"]["dash"] == "dash", branch.is_cut);
        assert_eq!(stroke["legendgroup"], if branch.is_cut { "cut" } else { "kept" });
    }
    let hovers = drawn["data"].to_string();
    assert_eq!(hovers.matches("gain of the cut").count(), 2);
    let mut colors = std::collections::BTreeSet::new();
    for cluster in 0..2 {
        let name = format!("cluster {}", cluster + 1);
        let marks = traces.iter().find(|t| t["name"] == name.as_str()).unwrap();
        let expected: Vec<f64> = given.nodes.iter().filter(|n| n.group == cluster).map(|n| n.x).collect();
        assert_eq!(marks["x"], serde_json::json!(expected));
        colors.insert(marks["marker"]["color"].to_string());
    }
    assert_eq!(colors.len(), 2);
    let leaders = traces.iter().find(|t| t["name"] == "active leader").unwrap();
    assert_eq!(leaders["x"].as_array().unwrap().len(), 2);
}

#[test]
fn the_same_report_is_the_same_page() {
    assert!(sample().to_html().unwrap() == sample().to_html().unwrap());
}

#[test]
fn markup_in_names_is_shown_and_not_obeyed() {
    let evil = "</script><script>alert(1)</script><b>\"&'";
    let (time, data) = record();
    let columns = Columns::new(&time, data.iter().map(|(name, y)| (name.as_str(), y.as_slice()))).unwrap();
    let mut agents = Agents::numbered(&K_P, &K_Q);
    agents.names[0] = evil.to_owned();
    let mut graph = topology(evil, true);
    graph.nodes[0].name = evil.to_owned();
    graph.note = evil.to_owned();
    let mut items: Vec<Item> = five_states(&columns, &agents, &[(3.0, evil.to_owned())])
        .unwrap()
        .into_iter()
        .map(Item::Figure)
        .collect();
    let mut tree = tree(evil);
    (tree.nodes[0].name, tree.branches[0].verdict, tree.note) =
        (evil.to_owned(), evil.to_owned(), evil.to_owned());
    items.push(Item::Tree(tree));
    items.push(Item::Graph(graph));
    items.push(Item::Table(Table {
        caption: evil.to_owned(),
        header: vec![evil.to_owned()],
        rows: vec![vec![evil.to_owned()]],
    }));
    let report = Report {
        title: evil.to_owned(),
        subtitle: evil.to_owned(),
        status: Some(Status { good: false, text: evil.to_owned() }),
        sections: vec![Section { heading: evil.to_owned(), text: evil.to_owned(), items }],
    };
    let html = report.to_html().unwrap();
    let own = own_part(&html);
    assert!(!own.contains("<script>alert") && !own.contains("<b>"));
    // The data, Plotly's (taken out above) and the page's own.
    assert_eq!(own.matches("<script").count(), 2);
    assert_eq!(own.matches("</script").count(), 2);
    let name = figure_data(&html)["figures"][0]["data"][0]["name"].as_str().unwrap().to_owned();
    assert!(name.starts_with("&lt;/script&gt;"), "{name}");
}

#[test]
fn a_thousand_agents_stay_a_light_page() {
    let time: Vec<f64> = (0..=1000).map(|k| f64::from(k) * 0.1).collect();
    let mut data = Vec::new();
    for i in 0..1000 {
        let phase = f64::from(i);
        for name in ["omega", "P", "E", "V", "Q"] {
            let y =
                time.iter().map(|t| 1.0 + 1e-3 * (phase + t).sin() * (-t / 30.0).exp()).collect::<Vec<_>>();
            data.push((format!("grid.{name}[{}]", i + 1), y));
        }
    }
    let columns = Columns::new(&time, data.iter().map(|(name, y)| (name.as_str(), y.as_slice()))).unwrap();
    let agents = Agents::numbered(&[0.004; 1000], &[0.02; 1000]);
    let crowd: Vec<_> = (0..8).map(|k| (30.0 + f64::from(k), format!("load step {k}"))).collect();
    let mut items = five_states(&columns, &agents, &crowd).unwrap();
    items.extend(error_systems(&columns, &agents, &crowd).unwrap());
    let section = Section { items: items.into_iter().map(Item::Figure).collect(), ..Section::default() };
    let report = Report { title: "1000 BESS".to_owned(), sections: vec![section], ..Report::default() };
    let html = report.to_html().unwrap();
    let bytes = html.len();
    assert!(bytes < 10_000_000, "{bytes} bytes");
}

#[test]
fn uneven_tables_and_lines_are_refused() {
    let table = Table { caption: "t".to_owned(), header: vec!["a".to_owned()], rows: vec![vec![]] };
    let section = Section { items: vec![Item::Table(table)], ..Section::default() };
    let report = Report { sections: vec![section], ..Report::default() };
    let message = report.to_html().unwrap_err().to_string();
    assert_eq!(message, "table `t`, row 1: found 0 values, expected 1 (one per column of the header)");
}

#[test]
fn a_report_without_figures_needs_no_script() {
    let html = Report { title: "only text".to_owned(), ..Report::default() }.to_html().unwrap();
    assert!(!html.contains("<script") && html.len() < 10_000);
    let empty = Section { items: vec![Item::Figure(Figure::default())], ..Section::default() };
    let html = Report { sections: vec![empty], ..Report::default() }.to_html().unwrap();
    assert_eq!(figure_data(&html)["figures"][0]["data"].as_array().unwrap().len(), 0);
}
