//! The checked-in bindings are what bindgen makes of the checked-in headers.
#![cfg(feature = "bindgen")]

#[test]
fn the_checked_in_bindings_are_fresh() {
    let made = include_str!(concat!(env!("OUT_DIR"), "/bindings.rs"));
    let kept = include_str!("../src/fmi/bindings.rs");
    assert!(made == kept, "src/fmi/bindings.rs is stale; copy {}/bindings.rs over it", env!("OUT_DIR"));
}

#[test]
fn so_are_those_of_fmi_3() {
    let made = include_str!(concat!(env!("OUT_DIR"), "/bindings3.rs"));
    let kept = include_str!("../src/fmi/three/bindings.rs");
    assert!(
        made == kept,
        "src/fmi/three/bindings.rs is stale; copy {}/bindings3.rs over it",
        env!("OUT_DIR")
    );
}
