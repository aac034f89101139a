//! Depth images.

use super::*;

/// Damaged depth images, each with what the message must contain.
fn spoiled_images() -> Vec<(Vec<u8>, &'static str)> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("x.png");
    let made = |size: (u32, u32), color, depth, bytes: usize| {
        write_png(&path, size, color, depth, &vec![7; bytes]);
        fs::read(&path).expect("read")
    };
    let whole = fs::read(good().join("0000/depth/0000.png")).expect("read");
    let pixels = 160 * 120;
    vec![
        (made((160, 120), ColorType::Grayscale, BitDepth::Eight, pixels), "8 bit Grayscale"),
        (made((160, 120), ColorType::Rgb, BitDepth::Eight, 3 * pixels), "8 bit Rgb"),
        (made((160, 120), ColorType::Rgb, BitDepth::Sixteen, 6 * pixels), "16 bit Rgb"),
        (
            made((160, 120), ColorType::GrayscaleAlpha, BitDepth::Sixteen, 4 * pixels),
            "16 bit GrayscaleAlpha",
        ),
        (made((80, 60), ColorType::Grayscale, BitDepth::Sixteen, pixels / 2), "80 x 60"),
        (whole[..whole.len() / 2].to_vec(), "not a whole PNG"),
        (whole[..20].to_vec(), "not a whole PNG"),
        (Vec::new(), "not a whole PNG"),
        (b"no picture at all".to_vec(), "not a whole PNG"),
        (png_claiming(1 << 20, 1 << 20), "1048576 x 1048576"),
        (png_claiming(0x7fff_ffff, 0x7fff_ffff), "not a whole PNG"),
    ]
}

/// A PNG header with a correct checksum and a size that fits no memory.
fn png_claiming(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([16, 0, 0, 0, 0]);
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    bytes.extend(&header);
    bytes.extend(crc32(&header).to_be_bytes());
    bytes.extend(b"\0\0\0\x02IDAT\x78\x9c");
    bytes.extend(crc32(b"IDAT\x78\x9c").to_be_bytes());
    bytes
}

/// The checksum of PNG (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg()))
    })
}

#[test]
fn one_spoiled_frame_is_told_and_its_view_stays() {
    // Four views at a time, so that the list of notes is not cut.
    for few in spoiled_images().chunks(4) {
        let bench = Bench::good();
        for (view, (bytes, _)) in few.iter().enumerate() {
            bench.put(&format!("{view:04}/depth/0001.png"), bytes);
        }
        let run = bench.calibrate();
        for (view, (_, says)) in few.iter().enumerate() {
            let told = format!("view {view:04}: frame left out");
            let line = run.stderr.lines().find(|l| l.contains(&told)).expect(&run.stderr);
            assert!(line.contains("0001.png") && line.contains(says), "{says}: {line}");
        }
        assert_eq!(used(&run.tells(&[])), common::GOOD_VIEWS);
    }
}

#[test]
fn a_view_of_spoiled_frames_is_told_and_the_others_stay() {
    let (bytes, says) = spoiled_images().swap_remove(0);
    let bench = Bench::good();
    bench.put("0003/depth/0000.png", &bytes).put("0003/depth/0001.png", &bytes);
    let result = bench.calibrate().tells(&["view 0003 was left out", "0000.png", says]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 1);
    assert_eq!(result["excluded"][0]["view"], "0003");
}

#[test]
fn nothing_but_spoiled_frames() {
    for (bytes, says) in spoiled_images() {
        let bench = Bench::good();
        for view in 0..common::GOOD_VIEWS {
            for frame in 0..2 {
                bench.put(&format!("{view:04}/depth/{frame:04}.png"), &bytes);
            }
        }
        bench.calibrate().fails(&["no view of 12", "view 0000", "0000.png", says]);
    }
}

#[test]
fn a_frame_or_a_view_without_any_depth() {
    let bench = Bench::good();
    let nothing = Frame { width: 160, height: 120, raw: vec![0; 160 * 120] };
    write_depth(&bench.file("0002/depth/0001.png"), &nothing);
    write_depth(&bench.file("0005/depth/0000.png"), &nothing);
    write_depth(&bench.file("0005/depth/0001.png"), &nothing);
    let result = bench.calibrate().tells(&[
        "view 0002: frame left out",
        "no pixel carries a depth",
        "view 0005 was left out",
    ]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 1);
}

#[test]
fn a_view_without_a_plane() {
    let bench = Bench::good();
    // A linear congruential generator: random depths of 0.4 to 4 m.
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        2000 + (state >> 16) as u16 % 18_000
    };
    let words = (0..160 * 120).map(|_| noise()).collect();
    let random = Frame { width: 160, height: 120, raw: words };
    let sphere = Frame { width: 160, height: 120, raw: sphere() };
    for (view, frame) in [("0004", &random), ("0007", &sphere)] {
        for name in ["0000", "0001"] {
            write_depth(&bench.file(&format!("{view}/depth/{name}.png")), frame);
        }
    }
    let result =
        bench.calibrate().tells(&["view 0004 was left out", "view 0007 was left out", "view.json"]);
    assert_eq!(used(&result), common::GOOD_VIEWS - 2);
    // A region of interest does not turn it into a plane.
    bench.put("0004/view.json", "{\"roi\": [40, 30, 120, 90]}");
    bench.calibrate().tells(&["view 0004 was left out", "view 0007 was left out"]);
}

/// Depth image of a ball of 0.3 m radius whose centre is 1.2 m away.
fn sphere() -> Vec<u16> {
    let (distance, radius) = (1.2f64, 0.3);
    (0..160 * 120)
        .map(|i| {
            let (x, y) = (((i % 160) as f64 - 79.5) / 145.0, ((i / 160) as f64 - 59.5) / 145.0);
            let a = 1.0 + x * x + y * y;
            let root = distance * distance - a * (distance * distance - radius * radius);
            if root > 0.0 { (5000.0 * (distance - root.sqrt()) / a) as u16 } else { 0 }
        })
        .collect()
}
