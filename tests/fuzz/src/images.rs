//! Depth PNGs, infrared and colour, PGMs and the index of a dump.

use kinoise::io::{
    Assumed, ColourImage, FrameSource, encode_pgm16, encode_png16_quickly, open_uncut,
    read_infrared,
};

use super::desk::{Desk, assumed, check, frame};

thread_local! {
    static DESK: Desk = Desk::new(&[]);
}

/// The first bytes of every PNG.
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The PNG with corrected checksums: with wrong ones nothing behind a chunk is looked at.
fn with_checksums(data: &[u8]) -> Vec<u8> {
    let mut png = data.to_vec();
    let mut at = SIGNATURE.len();
    while let Some(length) = png.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let end = at.saturating_add(8).saturating_add(length);
        let Some(chunk) = png.get(at + 4..end) else { break };
        let sum = crc32fast::hash(chunk).to_be_bytes();
        let Some(place) = png.get_mut(end..end + 4) else { break };
        place.copy_from_slice(&sum);
        at = end + 4;
    }
    png
}

/// Image size in the header of a PNG.
fn size(png: &[u8]) -> Option<[usize; 2]> {
    let header = png.strip_prefix(SIGNATURE)?.get(8..16)?;
    let number = |at: usize| {
        u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]) as usize
    };
    Some([number(0), number(4)])
}

/// A 16-bit PNG, read with the size in its header.
pub fn depth_png(data: &[u8]) -> bool {
    let png = with_checksums(data);
    let [width, height] = size(&png).unwrap_or([8, 6]);
    DESK.with(|desk| {
        let path = desk.put("depth.png", &png);
        let Ok(frame) = FrameSource::new(width, height).read(&path) else { return false };
        assert_eq!(frame.raw.len(), width * height);
        let path = desk.put("again.png", &encode_png16_quickly(&frame).expect("encoded"));
        let again = FrameSource::new(width, height).read(&path);
        assert_eq!(again.expect("what was written is read"), frame);
        true
    })
}

/// Maximum size of an image, px: larger ones take time and show nothing new.
const MAX_PICTURE: usize = 1 << 16;

/// Infrared and colour, PNG or JPEG, read with the size in a PNG's header.
pub fn picture(data: &[u8]) -> bool {
    let png = with_checksums(data);
    let small = |[w, h]: &[usize; 2]| w.saturating_mul(*h) <= MAX_PICTURE;
    let [width, height] = size(&png).filter(small).unwrap_or([8, 6]);
    DESK.with(|desk| {
        let path = desk.put("picture", &png);
        if let Ok(grey) = read_infrared(&path, [width, height]) {
            assert_eq!(grey.raw.len(), width * height);
        }
        let Ok(colour) = ColourImage::read(&path, [width, height]) else { return false };
        assert_eq!(colour.rgb.len(), 3 * width * height);
        true
    })
}

const PGM: &str = "d-1.000000-60000000.pgm";

/// A fakenect dump: after an even first byte the other bytes are its index, after an odd one its image.
pub fn dump(data: &[u8]) -> bool {
    thread_local! {
        static DUMP: Desk = Desk::new(&[]);
    }
    let Some((which, bytes)) = data.split_first() else { return false };
    let is_index = which % 2 == 0;
    DUMP.with(|desk| {
        match is_index {
            true => (desk.put(PGM, &encode_pgm16(&frame())), desk.put("INDEX.txt", bytes)),
            false => (desk.put(PGM, bytes), desk.put("INDEX.txt", PGM.as_bytes())),
        };
        // The camera is known for images of 640 x 480 px only.
        let camera = Assumed { code: None, ..assumed() };
        let Ok(recording) = open_uncut(desk.root(), &camera) else { return false };
        check(&recording);
        let camera = &recording.sensor.camera;
        let mut source = FrameSource::new(camera.width, camera.height);
        let first = source.frame(&recording.views[0].depth[0]).expect("its size was read");
        if !is_index {
            let path = desk.put("d-again.pgm", &encode_pgm16(&first));
            assert_eq!(source.read(&path).expect("what was written is read"), first);
        }
        true
    })
}
