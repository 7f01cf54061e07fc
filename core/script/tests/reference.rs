//! `API.md` lists what is registered.

#[test]
fn the_reference_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/API.md");
    let expected = choreo_script::reference();
    if std::env::var_os("CHOREO_ACCEPT").is_some() {
        std::fs::write(path, &expected).unwrap();
    }
    let got = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        got == expected,
        "API.md is out of date; CHOREO_ACCEPT=1 cargo test -p choreo-script writes it anew"
    );
}
