//! Data URIs (RFC 2397), base64 (RFC 4648 §4) and percent-encoding (RFC 3986 §2.1).

/// The bytes of a `data:` URI; `None` where the URI is not one.
pub fn data_uri(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let scheme = uri.get(..5)?;
    if !scheme.eq_ignore_ascii_case("data:") {
        return None;
    }
    let Some((head, body)) = uri[5..].split_once(',') else {
        return Some(Err("the data URI has no comma before its data".into()));
    };
    // `data:[type][;parameter=value]…[;base64],…`: the mark is the last of the head, in any case of letters.
    let marked = head.rsplit_once(';').is_some_and(|(_, last)| last.trim().eq_ignore_ascii_case("base64"));
    // Some writers escape the signs that mean something in URIs: + / =.
    Some(if marked { base64(&percent_decode(body)) } else { Ok(percent_decode(body)) })
}

/// A relative reference as a file name.
pub fn file_name(uri: &str) -> String {
    String::from_utf8_lossy(&percent_decode(uri)).into_owned()
}

fn percent_decode(text: &str) -> Vec<u8> {
    let hex = |b: u8| (b as char).to_digit(16).map(|d| d as u8);
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        if bytes[at] == b'%'
            && let (Some(hi), Some(lo)) =
                (bytes.get(at + 1).copied().and_then(hex), bytes.get(at + 2).copied().and_then(hex))
        {
            out.push(hi << 4 | lo);
            at += 3;
        } else {
            out.push(bytes[at]);
            at += 1;
        }
    }
    out
}

const NOT_BASE64: u8 = 255;

/// Value of each base64 letter; the URL-safe letters are accepted as well.
const SEXTETS: [u8; 256] = {
    let mut table = [NOT_BASE64; 256];
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut i = 0;
    while i < 64 {
        table[letters[i] as usize] = i as u8;
        i += 1;
    }
    table[b'-' as usize] = 62;
    table[b'_' as usize] = 63;
    table
};

fn base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let end = text.iter().rposition(|b| *b != b'=' && !b.is_ascii_whitespace()).map_or(0, |n| n + 1);
    let mut out = Vec::with_capacity(end / 4 * 3 + 3);
    let (mut bits, mut count) = (0u32, 0);
    for (at, letter) in text[..end].iter().enumerate() {
        let value = SEXTETS[*letter as usize];
        if value == NOT_BASE64 {
            if letter.is_ascii_whitespace() {
                continue;
            }
            return Err(format!("letter {at} of the base64 data, {:?}, is not base64", *letter as char));
        }
        bits = bits << 6 | u32::from(value);
        count += 1;
        if count == 4 {
            out.extend([(bits >> 16) as u8, (bits >> 8) as u8, bits as u8]);
            (bits, count) = (0, 0);
        }
    }
    match count {
        1 => return Err("the base64 data ends in the middle of a byte".into()),
        2 => out.push((bits >> 4) as u8),
        3 => out.extend([(bits >> 10) as u8, (bits >> 2) as u8]),
        _ => {}
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648 §10.
    #[test]
    fn base64_vectors() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(coded.as_bytes()).unwrap(), plain.as_bytes());
        }
        assert!(base64(b"Zg!=").unwrap_err().contains("letter 2"));
        assert!(base64(b"Zm9vY").is_err());
    }

    #[test]
    fn uris() {
        assert_eq!(data_uri("data:application/octet-stream;base64,Zm9v").unwrap().unwrap(), b"foo");
        assert_eq!(data_uri("data:,a%20b").unwrap().unwrap(), b"a b");
        for head in ["data:;base64", "DATA:text/plain;charset=utf-8;BASE64", "data:a/b;name=\"x\"; base64"] {
            for body in ["Zm9vYmE=", "Zm9v\r\n  YmE=\n", "Zm9vYmE%3D", "Zm9vYmE"] {
                assert_eq!(data_uri(&format!("{head},{body}")).unwrap().unwrap(), b"fooba", "{head},{body}");
            }
        }
        assert_eq!(data_uri("data:text/plain;charset=base64x,Zm9v").unwrap().unwrap(), b"Zm9v");
        assert!(data_uri("data:nothing").unwrap().is_err());
        assert!(data_uri("ä.bin").is_none());
        assert_eq!(file_name("my%20file%C3%A4%2.bin"), "my fileä%2.bin");
    }
}
