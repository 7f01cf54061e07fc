//! The MP4 container (ISO/IEC 14496-12, -14, -15) for one H.264 track. The index comes first, so that players and browsers start
//! at once. Written here instead of by a crate, so that the track's clock is the frame rate's exact ratio (NTSC rates too), a
//! video can be resumed after its program was killed, and colors and provenance have their boxes.

use choreo_motion::FrameRate;
use std::io::{self, Write};

pub(crate) struct Muxer {
    width: u16,
    height: u16,
    fps: FrameRate,
    provenance: Vec<(String, String)>,
    /// Bytes of the current image so far, and whether a player can start at it.
    size: u32,
    key: bool,
    sizes: Vec<u32>,
    /// Frames at which a player can start, counted from 1.
    keys: Vec<u32>,
    sps: Vec<u8>,
    pps: Vec<u8>,
    /// Number of frames that `take_state` has reported.
    reported: usize,
}

/// Flag in an image's size in a state: a player can start at the image. Images are far below 2 GiB.
const KEY_FRAME_FLAG: u32 = 1 << 31;

impl Muxer {
    pub(crate) fn new(width: u16, height: u16, fps: FrameRate, provenance: Vec<(String, String)>) -> Muxer {
        Muxer {
            width,
            height,
            fps,
            provenance,
            size: 0,
            key: false,
            sizes: Vec::new(),
            keys: Vec::new(),
            sps: Vec::new(),
            pps: Vec::new(),
            reported: 0,
        }
    }

    /// Adds a NAL unit, with its Annex B start code, to the current image. Parameter sets go to the index instead.
    pub(crate) fn nal(&mut self, nal: &[u8], out: &mut dyn Write) -> io::Result<()> {
        let nal = nal.strip_prefix(&[0, 0, 0, 1]).or(nal.strip_prefix(&[0, 0, 1])).unwrap_or(nal);
        // nal_unit_type, H.264 table 7-1.
        match nal.first().map(|b| b & 31) {
            None => return Ok(()),
            Some(7) => {
                self.sps = nal.to_vec();
                return Ok(());
            }
            Some(8) => {
                self.pps = nal.to_vec();
                return Ok(());
            }
            Some(5) => self.key = true,
            Some(_) => {}
        }
        out.write_all(&(nal.len() as u32).to_be_bytes())?;
        out.write_all(nal)?;
        self.size += 4 + nal.len() as u32;
        Ok(())
    }

    /// Ends the current image; false where it is empty.
    pub(crate) fn end_picture(&mut self) -> bool {
        let size = std::mem::take(&mut self.size);
        self.sizes.push(size);
        if std::mem::take(&mut self.key) {
            self.keys.push(self.sizes.len() as u32);
        }
        size > 0
    }

    /// The data that the index needs of the frames since the last call: the parameter sets, each with its length, then the sizes.
    pub(crate) fn take_state(&mut self) -> Vec<u8> {
        let mut state = Vec::new();
        for set in [&self.sps, &self.pps] {
            state.extend((set.len() as u32).to_le_bytes());
            state.extend(set);
        }
        for (i, size) in self.sizes.iter().enumerate().skip(self.reported) {
            let key = self.keys.binary_search(&(i as u32 + 1)).is_ok();
            state.extend((size | if key { KEY_FRAME_FLAG } else { 0 }).to_le_bytes());
        }
        self.reported = self.sizes.len();
        state
    }

    /// Restores data that `take_state` returned.
    pub(crate) fn add_state(&mut self, state: &[u8]) -> io::Result<()> {
        let cut = || io::Error::other("the saved index of the video is incomplete");
        let mut rest = state;
        for set in [&mut self.sps, &mut self.pps] {
            let (length, more) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
            let (bytes, more) =
                more.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(cut)?;
            *set = bytes.to_vec();
            rest = more;
        }
        let (sizes, []) = rest.as_chunks::<4>() else { return Err(cut()) };
        for size in sizes.iter().map(|s| u32::from_le_bytes(*s)) {
            self.sizes.push(size & !KEY_FRAME_FLAG);
            if size & KEY_FRAME_FLAG != 0 {
                self.keys.push(self.sizes.len() as u32);
            }
        }
        self.reported = self.sizes.len();
        Ok(())
    }

    /// All boxes before the image data.
    pub(crate) fn head(&self) -> io::Result<Vec<u8>> {
        if self.sizes.is_empty() || self.sps.len() < 4 || self.pps.is_empty() {
            return Err(io::Error::other("an MP4 needs at least one image, and there was none"));
        }
        let ftyp = mp4_box(b"ftyp", &[b"isom", &0x200u32.to_be_bytes(), b"isomiso2avc1mp41"]);
        let data: u64 = self.sizes.iter().map(|s| u64::from(*s)).sum();
        let large = data + 16 > u64::from(u32::MAX);
        // The index contains the position of the data, which depends on the length of the index, which does not depend on the
        // position.
        let length = self.moov(0).len() as u64;
        let data_at = ftyp.len() as u64 + length + if large { 16 } else { 8 };
        let mut head = ftyp;
        head.extend(self.moov(data_at));
        if large {
            head.extend(1u32.to_be_bytes());
            head.extend(b"mdat");
            head.extend((data + 16).to_be_bytes());
        } else {
            head.extend(((data + 8) as u32).to_be_bytes());
            head.extend(b"mdat");
        }
        Ok(head)
    }

    fn moov(&self, data_at: u64) -> Vec<u8> {
        let frames = self.sizes.len() as u64;
        // The track counts in units of 1/num s, and a frame lasts den units; the movie counts in milliseconds.
        let track_length = frames * u64::from(self.fps.den);
        let movie_length = (track_length * 1000).div_ceil(u64::from(self.fps.num));
        let (w, h) = (self.width, self.height);
        let matrix = [0x10000u32, 0, 0, 0, 0x10000, 0, 0, 0, 0x4000_0000].map(u32::to_be_bytes).concat();
        // Version 1 boxes have 64-bit times. All creation times are zero, so that equal frames give equal files.
        let mvhd = full_box(
            b"mvhd",
            1,
            0,
            &[
                &[0; 16],
                &u32_be(1000),
                &movie_length.to_be_bytes(),
                &u32_be(0x10000),
                &[1, 0],
                &[0; 10],
                &matrix,
                &[0; 24],
                &u32_be(2),
            ],
        );
        let tkhd = full_box(
            b"tkhd",
            1,
            3,
            &[
                &[0; 16],
                &u32_be(1),
                &[0; 4],
                &movie_length.to_be_bytes(),
                &[0; 16],
                &matrix,
                &u32_be(u32::from(w) << 16),
                &u32_be(u32::from(h) << 16),
            ],
        );
        // Language "und": three letters minus 0x60, in 5 bits each.
        let mdhd = full_box(
            b"mdhd",
            1,
            0,
            &[&[0; 16], &u32_be(self.fps.num), &track_length.to_be_bytes(), &[0x55, 0xc4, 0, 0]],
        );
        let hdlr = full_box(b"hdlr", 0, 0, &[&[0; 4], b"vide", &[0; 12], b"choreo\0"]);
        let vmhd = full_box(b"vmhd", 0, 1, &[&[0; 8]]);
        let url = full_box(b"url ", 0, 1, &[]);
        let dinf = mp4_box(b"dinf", &[&full_box(b"dref", 0, 0, &[&u32_be(1), &url])]);
        let stbl = self.sample_table(data_at);
        let minf = mp4_box(b"minf", &[&vmhd, &dinf, &stbl]);
        let mdia = mp4_box(b"mdia", &[&mdhd, &hdlr, &minf]);
        let trak = mp4_box(b"trak", &[&tkhd, &mdia]);
        mp4_box(b"moov", &[&mvhd, &trak, &self.metadata()])
    }

    fn sample_table(&self, data_at: u64) -> Vec<u8> {
        let avcc = mp4_box(
            b"avcC",
            &[
                // Profile, constraints and level from the SPS; 4-byte NAL lengths; one SPS, one PPS.
                &[1, self.sps[1], self.sps[2], self.sps[3], 0xff, 0xe1],
                &(self.sps.len() as u16).to_be_bytes(),
                &self.sps,
                &[1],
                &(self.pps.len() as u16).to_be_bytes(),
                &self.pps,
            ],
        );
        // BT.709 primaries, transfer and matrix, limited range; square pixels.
        let colr = mp4_box(b"colr", &[b"nclx", &[0, 1, 0, 1, 0, 1, 0]]);
        let pasp = mp4_box(b"pasp", &[&u32_be(1), &u32_be(1)]);
        let mut name = [0u8; 32];
        name[..7].copy_from_slice(b"\x06choreo");
        let avc1 = mp4_box(
            b"avc1",
            &[
                &[0; 6],
                &[0, 1],
                &[0; 16],
                &self.width.to_be_bytes(),
                &self.height.to_be_bytes(),
                &u32_be(0x48_0000),
                &u32_be(0x48_0000),
                &[0; 4],
                &[0, 1],
                &name,
                &[0, 24, 0xff, 0xff],
                &avcc,
                &colr,
                &pasp,
            ],
        );
        let count = self.sizes.len() as u32;
        let stsd = full_box(b"stsd", 0, 0, &[&u32_be(1), &avc1]);
        let stts = full_box(b"stts", 0, 0, &[&u32_be(1), &u32_be(count), &u32_be(self.fps.den)]);
        let list = |values: &[u32]| values.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>();
        let stss = full_box(b"stss", 0, 0, &[&u32_be(self.keys.len() as u32), &list(&self.keys)]);
        // A single chunk holds all frames.
        let stsc = full_box(b"stsc", 0, 0, &[&u32_be(1), &u32_be(1), &u32_be(count), &u32_be(1)]);
        let stsz = full_box(b"stsz", 0, 0, &[&u32_be(0), &u32_be(count), &list(&self.sizes)]);
        let co64 = full_box(b"co64", 0, 0, &[&u32_be(1), &data_at.to_be_bytes()]);
        mp4_box(b"stbl", &[&stsd, &stts, &stss, &stsc, &stsz, &co64])
    }

    /// iTunes-style metadata, which players and `ffprobe` show: the provenance as one comment.
    fn metadata(&self) -> Vec<u8> {
        let text: Vec<String> = self.provenance.iter().map(|(k, v)| format!("{k}: {v}")).collect();
        if text.is_empty() {
            return Vec::new();
        }
        let data = mp4_box(b"data", &[&u32_be(1), &[0; 4], text.join("\n").as_bytes()]);
        let ilst = mp4_box(b"ilst", &[&mp4_box(b"\xa9cmt", &[&data])]);
        let hdlr = full_box(b"hdlr", 0, 0, &[&[0; 4], b"mdirappl", &[0; 9]]);
        mp4_box(b"udta", &[&full_box(b"meta", 0, 0, &[&hdlr, &ilst])])
    }
}

fn u32_be(v: u32) -> [u8; 4] {
    v.to_be_bytes()
}

fn mp4_box(kind: &[u8; 4], parts: &[&[u8]]) -> Vec<u8> {
    let size = 8 + parts.iter().map(|p| p.len()).sum::<usize>();
    let mut out = Vec::with_capacity(size);
    // Boxes made here stay far below 4 GiB: the index takes 4 bytes a frame, and the image data get their header elsewhere.
    out.extend((size as u32).to_be_bytes());
    out.extend(kind);
    parts.iter().for_each(|p| out.extend_from_slice(p));
    out
}

fn full_box(kind: &[u8; 4], version: u8, flags: u32, parts: &[&[u8]]) -> Vec<u8> {
    let head = (u32::from(version) << 24 | flags).to_be_bytes();
    let mut all: Vec<&[u8]> = vec![&head];
    all.extend(parts);
    mp4_box(kind, &all)
}
