//! CAK: clusters from distances by Kruskal's minimum spanning tree and cuts of its long edges, (7), (8)
//! as DESIGN reads them. Knows distances only; what the clusters are used for is in `topology`.

/// A tree edge between two agents (from 0), and its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// One end.
    pub a: usize,
    /// The other end.
    pub b: usize,
    /// Distance between them.
    pub length: f64,
}

/// A cut that was made or weighed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// The tree edge.
    pub link: Link,
    /// By how much it lowers the size-weighted standard deviation of the trees' edges; delta_k of (7).
    pub gain: f64,
    /// What becomes of it by (8).
    pub verdict: Verdict,
}

/// What (8) makes of a cut: they stand up to the last one whose gain reaches that of the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The first cut stands; the others are held against its gain.
    First,
    /// Stands: gains as much as the first.
    Gains,
    /// Gains less than the first, but stands, because a later cut gains as much.
    OnTheWay,
    /// Does not stand: neither it nor a later one gains as much as the first.
    Kept,
}

impl Verdict {
    /// Whether the tree is cut there.
    pub fn is_cut(self) -> bool {
        self != Self::Kept
    }
}

/// The clusters, and how they came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Clustering {
    /// Cluster of each agent, from 0, numbered in the order of their lowest agents.
    pub cluster: Vec<usize>,
    /// The minimum spanning tree, shortest edge first.
    pub tree: Vec<Link>,
    /// The cuts in the order in which they were weighed.
    pub cuts: Vec<Cut>,
    /// Agents that a cut had left alone and that joined the nearest cluster.
    pub joined: Vec<usize>,
}

impl Clustering {
    /// Number of clusters.
    pub fn count(&self) -> usize {
        self.cluster.iter().max().map_or(0, |&c| c + 1)
    }
}

/// Kruskal's minimum spanning tree over `members`, shortest edge first; ties to the lower agents.
pub fn minimum_spanning_tree(members: &[usize], distances: &[Vec<f64>]) -> Vec<Link> {
    let mut links = Vec::with_capacity(members.len() * members.len().saturating_sub(1) / 2);
    for (k, &a) in members.iter().enumerate() {
        for &b in &members[k + 1..] {
            links.push(Link { a: a.min(b), b: a.max(b), length: distances[a][b] });
        }
    }
    links.sort_by(|x, y| x.length.total_cmp(&y.length).then((x.a, x.b).cmp(&(y.a, y.b))));
    let mut sets = Sets::new(distances.len());
    links.retain(|link| sets.join(link.a, link.b));
    links
}

/// (7), (8): among the tree edges longer than the mean of those left, cut the one with the largest gain,
/// up to the last cut whose gain is at or above that of the first. A BESS left alone joins the cluster
/// of the BESS nearest to it.
pub fn cluster(distances: &[Vec<f64>]) -> Clustering {
    let n = distances.len();
    let everyone: Vec<usize> = (0..n).collect();
    let tree = minimum_spanning_tree(&everyone, distances);
    let cuts = weigh_cuts(n, &tree);
    let mut sets = Sets::new(n);
    for link in &tree {
        if !cuts.iter().any(|cut| cut.verdict.is_cut() && cut.link == *link) {
            sets.join(link.a, link.b);
        }
    }
    let joined = join_the_isolated(&mut sets, distances);
    Clustering { cluster: sets.numbered(), tree, cuts, joined }
}

fn weigh_cuts(n: usize, tree: &[Link]) -> Vec<Cut> {
    let mut forest = Forest::new(n, tree);
    let mut cuts: Vec<Cut> = Vec::new();
    let mut deviation = forest.deviation(0);
    while let Some((position, gain)) = forest.best() {
        // What is left to gain is the deviation itself: once it is below the first gain, (8) holds for good.
        let first = cuts.first().map_or(0.0, |cut| cut.gain);
        if gain <= 0.0 || deviation < first {
            break;
        }
        deviation -= gain;
        forest.cut(position);
        cuts.push(Cut { link: tree[position], gain, verdict: Verdict::Kept });
    }
    if let Some(first) = cuts.first().map(|cut| cut.gain) {
        let last = cuts.iter().rposition(|cut| cut.gain >= first).unwrap_or(0);
        for (k, cut) in cuts[..=last].iter_mut().enumerate() {
            cut.verdict = match k {
                0 => Verdict::First,
                _ if cut.gain >= first => Verdict::Gains,
                _ => Verdict::OnTheWay,
            };
        }
        // One cut beyond the last shows why the cutting ended.
        cuts.truncate(last + 2);
    }
    cuts
}

/// The trees that the cuts have left, with the gain of every possible next cut.
struct Forest<'a> {
    n: usize,
    tree: &'a [Link],
    present: Vec<bool>,
    gains: Vec<f64>,
    /// Positions in `tree` of the edges at each agent.
    at: Vec<Vec<usize>>,
}

impl<'a> Forest<'a> {
    fn new(n: usize, tree: &'a [Link]) -> Self {
        let mut at = vec![Vec::new(); n];
        for (position, link) in tree.iter().enumerate() {
            at[link.a].push(position);
            at[link.b].push(position);
        }
        let mut forest = Self { n, tree, present: vec![true; tree.len()], gains: vec![0.0; tree.len()], at };
        if n > 0 {
            forest.weigh(0);
        }
        forest
    }

    /// Edges of the tree that `agent` is in, without the edge `without`, and its number of agents.
    fn tree_of(&self, agent: usize, without: Option<usize>) -> (Vec<usize>, usize) {
        let (mut edges, mut agents) = (Vec::new(), 0);
        let mut stack = vec![(agent, None)];
        while let Some((i, from)) = stack.pop() {
            agents += 1;
            for &position in &self.at[i] {
                if self.present[position] && Some(position) != from && Some(position) != without {
                    edges.push(position);
                    let link = self.tree[position];
                    stack.push((if link.a == i { link.b } else { link.a }, Some(position)));
                }
            }
        }
        edges.sort_unstable();
        (edges, agents)
    }

    /// Share of one tree in the size-weighted standard deviation.
    fn share(&self, edges: &[usize], agents: usize) -> f64 {
        if edges.is_empty() {
            return 0.0;
        }
        let count = edges.len() as f64;
        let mean = edges.iter().map(|&e| self.tree[e].length).sum::<f64>() / count;
        let variance = edges.iter().map(|&e| (self.tree[e].length - mean).powi(2)).sum::<f64>() / count;
        variance.sqrt() * agents as f64 / self.n as f64
    }

    fn deviation(&self, agent: usize) -> f64 {
        if self.n == 0 {
            return 0.0;
        }
        let (edges, agents) = self.tree_of(agent, None);
        self.share(&edges, agents)
    }

    /// Brings the gains of the edges of one tree up to date.
    fn weigh(&mut self, agent: usize) {
        let (edges, agents) = self.tree_of(agent, None);
        let whole = self.share(&edges, agents);
        for &position in &edges {
            let link = self.tree[position];
            let parts: f64 = [link.a, link.b]
                .into_iter()
                .map(|end| {
                    let (edges, agents) = self.tree_of(end, Some(position));
                    self.share(&edges, agents)
                })
                .sum();
            self.gains[position] = whole - parts;
        }
    }

    /// The cut with the largest gain among the edges longer than the mean of those left.
    fn best(&self) -> Option<(usize, f64)> {
        let left = || (0..self.tree.len()).filter(|&k| self.present[k]);
        let mean = left().map(|k| self.tree[k].length).sum::<f64>() / left().count() as f64;
        // Edges equal to the mean but for rounding are not longer than it.
        let long = left().filter(|&k| self.tree[k].length > mean * (1.0 + 1e-12));
        long.map(|k| (k, self.gains[k])).max_by(|x, y| x.1.total_cmp(&y.1).then(y.0.cmp(&x.0)))
    }

    fn cut(&mut self, position: usize) {
        self.present[position] = false;
        let link = self.tree[position];
        self.weigh(link.a);
        self.weigh(link.b);
    }
}

fn join_the_isolated(sets: &mut Sets, distances: &[Vec<f64>]) -> Vec<usize> {
    let n = distances.len();
    let nearest = |i: usize| {
        (0..n)
            .filter(|&j| j != i)
            .min_by(|&x, &y| distances[i][x].total_cmp(&distances[i][y]).then(x.cmp(&y)))
    };
    let mut alone: Vec<(usize, usize)> =
        (0..n).filter(|&i| sets.size(i) == 1).filter_map(|i| Some((i, nearest(i)?))).collect();
    alone.sort_by(|x, y| distances[x.0][x.1].total_cmp(&distances[y.0][y.1]).then(x.cmp(y)));
    let mut joined = Vec::new();
    for (i, neighbour) in alone {
        // An earlier joiner may have ended its loneliness already.
        if sets.size(i) == 1 && sets.join(i, neighbour) {
            joined.push(i);
        }
    }
    joined
}

/// Disjoint sets of agents.
struct Sets {
    parent: Vec<usize>,
    size: Vec<usize>,
}

impl Sets {
    fn new(n: usize) -> Self {
        Self { parent: (0..n).collect(), size: vec![1; n] }
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.parent[i] != i {
            self.parent[i] = self.parent[self.parent[i]];
            i = self.parent[i];
        }
        i
    }

    fn size(&mut self, i: usize) -> usize {
        let root = self.root(i);
        self.size[root]
    }

    /// False when they were together already.
    fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return false;
        }
        let (small, large) = if self.size[a] < self.size[b] { (a, b) } else { (b, a) };
        self.parent[small] = large;
        self.size[large] += self.size[small];
        true
    }

    fn numbered(&mut self) -> Vec<usize> {
        let n = self.parent.len();
        let mut number = vec![usize::MAX; n];
        let mut next = 0;
        (0..n)
            .map(|i| {
                let root = self.root(i);
                if number[root] == usize::MAX {
                    number[root] = next;
                    next += 1;
                }
                number[root]
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_a_line(x: &[f64]) -> Vec<Vec<f64>> {
        x.iter().map(|a| x.iter().map(|b| f64::abs(a - b)).collect()).collect()
    }

    #[test]
    fn two_groups_on_a_line_are_cut_once_with_the_gain_computed_by_hand() {
        // Tree edges 1, 1, 8, 1, 1: mean 2.4, variance (4 * 1.96 + 31.36) / 5 = 7.84; both parts have none.
        let found = cluster(&on_a_line(&[0.0, 1.0, 2.0, 10.0, 11.0, 12.0]));
        assert_eq!(found.cluster, [0, 0, 0, 1, 1, 1]);
        assert!((found.cuts[0].gain - 2.8).abs() < 1e-12);
        assert_eq!(found.cuts.iter().filter(|c| c.verdict.is_cut()).count(), 1);
    }

    #[test]
    fn equal_distances_and_tiny_fleets_stay_together() {
        assert_eq!(cluster(&on_a_line(&[0.0, 1.0, 2.0, 3.0])).cluster, [0, 0, 0, 0]);
        assert_eq!(cluster(&on_a_line(&[0.0, 5.0])).cluster, [0, 0]);
        assert_eq!(cluster(&on_a_line(&[0.0])).cluster, [0]);
    }

    #[test]
    fn a_bess_left_alone_joins_the_nearest_cluster() {
        let found = cluster(&on_a_line(&[0.0, 1.0, 2.0, 9.0]));
        assert_eq!(found.cluster, [0, 0, 0, 0]);
        assert_eq!(found.joined, [3]);
    }
}
