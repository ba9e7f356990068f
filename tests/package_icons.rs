//! The icons that the FMUs carry are what their drawings give. `cargo xtask generate icons` writes them anew.
#![cfg(feature = "host")]
#![allow(clippy::unwrap_used)]

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use std::path::{Path, PathBuf};

fn file(name: &str, extension: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/package/icons").join(format!("{name}.{extension}"))
}

fn rendered(name: &str) -> Pixmap {
    let drawing = std::fs::read(file(name, "svg")).unwrap();
    let tree = Tree::from_data(&drawing, &Options::default()).unwrap();
    let size = tree.size().to_int_size();
    let mut pixels = Pixmap::new(size.width(), size.height()).unwrap();
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    pixels
}

#[test]
fn the_icons_are_those_of_the_drawings() {
    for name in ["BessConsensus", "BessGrid"] {
        let fresh = rendered(name);
        let checked_in = file(name, "png");
        if std::env::var_os("BESS_WRITE_ICONS").is_some() {
            fresh.save_png(&checked_in).unwrap();
        }
        let stored = Pixmap::load_png(&checked_in).unwrap();
        assert_eq!((stored.width(), stored.height()), (256, 256));
        assert!(stored.data() == fresh.data(), "{name}.png is stale: run `cargo xtask generate icons`");
        // Something is drawn, on a ground that lets the canvas of a tool through.
        let opaque = stored.pixels().iter().filter(|p| p.alpha() == 255).count();
        assert!((20_000..60_000).contains(&opaque), "{name}: {opaque} opaque pixels");
    }
}
