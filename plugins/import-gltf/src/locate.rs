//! Finds the element of a JSON text at an offset, for error messages: `accessors[3].count`.

enum Level {
    Object { key: String },
    Array { index: usize },
}

/// The path of the innermost value at or before `offset`. Broken JSON works too, because only strings and brackets matter.
pub(crate) fn element_at(json: &[u8], offset: usize) -> String {
    let mut levels: Vec<Level> = Vec::new();
    let mut at = 0;
    let mut last_string = String::new();
    while at < offset.min(json.len()) {
        match json[at] {
            b'"' => {
                let start = at + 1;
                at = start;
                while at < json.len() && json[at] != b'"' {
                    at += if json[at] == b'\\' { 2 } else { 1 };
                }
                last_string = String::from_utf8_lossy(&json[start..at.min(json.len())]).into_owned();
            }
            b'{' => levels.push(Level::Object { key: String::new() }),
            b'[' => levels.push(Level::Array { index: 0 }),
            b'}' | b']' => {
                levels.pop();
            }
            b':' => {
                if let Some(Level::Object { key }) = levels.last_mut() {
                    *key = std::mem::take(&mut last_string);
                }
            }
            b',' => {
                if let Some(Level::Array { index }) = levels.last_mut() {
                    *index += 1;
                }
            }
            _ => {}
        }
        at += 1;
    }
    let mut path = String::new();
    for level in &levels {
        match level {
            Level::Object { key } if key.is_empty() => {}
            Level::Object { key } if path.is_empty() => path.push_str(key),
            Level::Object { key } => {
                path.push('.');
                path.push_str(key);
            }
            Level::Array { index } => path.push_str(&format!("[{index}]")),
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_offset_gives_the_path_of_its_json_element() {
        let json = br#"{"a":[1,{"b":"x\",[{","c":[[2],7]}],"d":4}"#;
        let at = |needle: &str| {
            let text = std::str::from_utf8(json).unwrap();
            element_at(json, text.find(needle).unwrap())
        };
        assert_eq!(at("1,"), "a[0]");
        assert_eq!(at("7"), "a[1].c[1]");
        assert_eq!(at("2]"), "a[1].c[0][0]");
        assert_eq!(at("4}"), "d");
        assert_eq!(element_at(b"{\"a\":[\"unclosed", 999), "a[0]");
        assert_eq!(element_at(b"]]]}", 4), "");
    }
}
