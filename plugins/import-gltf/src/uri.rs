//! Data URIs (RFC 2397), base64 (RFC 4648 §4) and percent-encoding (RFC 3986 §2.1).

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine};
use choreo_importer_kit::Result;
use choreo_importer_kit::text::percent_decoded;

/// The bytes of a `data:` URI; `None` where the URI is not one.
pub(crate) fn data_uri(uri: &str) -> Option<Result<Vec<u8>>> {
    let scheme = uri.get(..5)?;
    if !scheme.eq_ignore_ascii_case("data:") {
        return None;
    }
    let Some((head, body)) = uri[5..].split_once(',') else {
        return Some(Err("the data URI has no comma before its data".into()));
    };
    // `data:[type][;parameter=value]…[;base64],…`: `;base64`, in any letter case, comes last before the comma.
    let marked = head.rsplit_once(';').is_some_and(|(_, last)| last.trim().eq_ignore_ascii_case("base64"));
    // Some writers percent-encode characters that have a meaning in URIs: + / =.
    Some(if marked { base64(&percent_decoded(body)) } else { Ok(percent_decoded(body)) })
}

/// A relative reference as a file name: percent-decoded.
pub(crate) fn file_name(uri: &str) -> String {
    String::from_utf8_lossy(&percent_decoded(uri)).into_owned()
}

/// Decodes base64 in the standard or the URL-safe alphabet. White space and padding are skipped.
fn base64(text: &[u8]) -> Result<Vec<u8>> {
    let letter = |b: &u8| match b {
        b'-' => b'+',
        b'_' => b'/',
        other => *other,
    };
    let letters: Vec<u8> = text.iter().filter(|b| !b.is_ascii_whitespace()).map(letter).collect();
    let end = letters.iter().rposition(|b| *b != b'=').map_or(0, |last| last + 1);
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::RequireNone)
        .with_decode_allow_trailing_bits(true);
    GeneralPurpose::new(&STANDARD, config).decode(&letters[..end]).map_err(|error| match error {
        DecodeError::InvalidByte(at, byte) => {
            format!("letter {at} of the base64 data, {:?}, is not base64", byte as char).into()
        }
        _ => "the base64 data ends in the middle of a byte".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648 §10.
    #[test]
    fn base64_decodes_the_test_vectors() {
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
        assert!(base64(b"Zg!=").unwrap_err().what.contains("letter 2"));
        assert!(base64(b"Zm9vY").is_err());
    }

    #[test]
    fn data_uris_and_file_names_are_parsed() {
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
