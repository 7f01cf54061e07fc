//! Cryptomatte ids (Psyop, "Cryptomatte Specification 1.2.0"): names as hashes, stored as the bits of floats, with their shares of each pixel.

use choreo_plugin::IdMatte;
use std::collections::BTreeMap;

/// One Cryptomatte layer, with its header attributes.
pub(crate) struct Cryptomatte<'a> {
    /// The name of the layer: `CryptoObject`, `CryptoMaterial`.
    pub layer: &'static str,
    pub matte: &'a IdMatte,
}

impl Cryptomatte<'_> {
    /// Header attributes, as (name, value).
    pub(crate) fn attributes(&self) -> Vec<(String, String)> {
        // The first seven digits of the hash of the layer's name tell the layers of a file apart.
        let key = &format!("{:08x}", id_of(self.layer))[..7];
        let manifest: BTreeMap<&str, String> =
            self.matte.names.iter().map(|name| (name.as_str(), format!("{:08x}", id_of(name)))).collect();
        let entry = |name: &str, value: String| (format!("cryptomatte/{key}/{name}"), value);
        vec![
            entry("name", self.layer.into()),
            entry("hash", "MurmurHash3_32".into()),
            entry("conversion", "uint32_to_float32".into()),
            entry("manifest", serde_json::json!(manifest).to_string()),
        ]
    }

    /// Float channels, two ranks to a layer of four: id and share (R, G), id and share (B, A).
    pub(crate) fn channels(&self) -> Vec<(String, Vec<f32>)> {
        let ids: Vec<f32> = self.matte.names.iter().map(|name| f32::from_bits(id_of(name))).collect();
        let mut all = Vec::new();
        for (rank, shares) in self.matte.ranks.iter().enumerate() {
            let names = if rank % 2 == 0 { ["R", "G"] } else { ["B", "A"] };
            let [id, share] = names.map(|name| format!("{}{:02}.{name}", self.layer, rank / 2));
            let id_at = |number: u32| number.checked_sub(1).and_then(|i| ids.get(i as usize)).copied();
            all.push((id, shares.iter().map(|s| id_at(s.number).unwrap_or(0.0)).collect()));
            all.push((share, shares.iter().map(|s| s.share).collect()));
        }
        // Readers expect all four channels of a layer, so an odd last rank is filled up with zeros.
        if self.matte.ranks.len() % 2 == 1 {
            let pixels = self.matte.ranks.first().map_or(0, Vec::len);
            let last = self.matte.ranks.len() / 2;
            all.extend(["B", "A"].map(|name| (format!("{}{last:02}.{name}", self.layer), vec![0.0; pixels])));
        }
        all
    }
}

/// The id of a name: its hash, with one bit of the exponent flipped where the float would be a denormal, an infinity or NaN, which
/// programs do not keep.
pub(crate) fn id_of(name: &str) -> u32 {
    let hash = murmur3_32(name.as_bytes());
    match hash >> 23 & 0xff {
        0 | 0xff => hash ^ 1 << 23,
        _ => hash,
    }
}

/// MurmurHash3_x86_32 by Austin Appleby, with the seed 0.
fn murmur3_32(bytes: &[u8]) -> u32 {
    let scrambled = |block: u32| block.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (blocks, tail) = bytes.as_chunks::<4>();
    let mut hash = 0u32;
    for block in blocks {
        hash ^= scrambled(u32::from_le_bytes(*block));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    let rest = tail.iter().rev().fold(0, |rest, byte| rest << 8 | u32::from(*byte));
    hash ^= scrambled(rest) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn murmur3_hashes_equal_published_values() {
        // Printed by the PyPI package mmh3.
        for (name, hash) in
            [("", 0), ("hello", 0x248b_fa47), ("hello, world", 0x149b_bb7f), ("a", 0x3c25_69b2)]
        {
            assert_eq!(murmur3_32(name.as_bytes()), hash, "{name}");
        }
        assert_eq!(id_of(""), 1 << 23);
    }
}
