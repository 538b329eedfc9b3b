//! The numbers of Tables 1 and 2 of Peng & Cao 2012, *A GPU-based Approach for Massive Model Rendering with
//! Frame-to-Frame Coherence*, as printed there.

/// What it was measured on.
pub const MACHINE: &str = "Intel Core i7 at 2.67 GHz, 12 GB, NVIDIA Quadro 5000 with 2.5 GB";

/// A row of Table 1: the Boeing 777 by one strategy.
#[derive(Debug)]
pub struct Streaming {
    /// The paper's name: SC, SnC or NS.
    pub strategy: &'static str,
    /// The camera setting, (a) or (b).
    pub camera: &'static str,
    /// Frames per second.
    pub fps: f64,
    /// Milliseconds of the CPU for finding and gathering what is sent.
    pub collection_ms: Option<f64>,
    /// Milliseconds from CPU to GPU.
    pub transfer_ms: f64,
    /// Milliseconds of the GPU.
    pub defragment_ms: Option<f64>,
    /// Triangles and vertices drawn.
    pub active: (u64, u64),
    /// Triangles and vertices sent.
    pub streamed: (u64, u64),
}

const A: (u64, u64) = (5_814_786, 3_879_636);
const B: (u64, u64) = (17_373_329, 14_501_553);

/// Table 1.
pub const STREAMING: [Streaming; 6] = [
    streaming("SC", "(a)", 14.0, [Some(13.63), Some(5.13), Some(19.68)], A, (2_314, 1_657)),
    streaming("SC", "(b)", 6.0, [Some(15.36), Some(12.02), Some(59.64)], B, (6_649, 5_476)),
    streaming("SnC", "(a)", 12.0, [Some(26.69), Some(48.82), None], A, A),
    streaming("SnC", "(b)", 5.0, [Some(68.26), Some(139.82), None], B, B),
    streaming("NS", "(a)", 2.0, [None, Some(762.46), None], A, A),
    streaming("NS", "(b)", 2.0, [None, Some(419.81), None], B, B),
];

const fn streaming(
    strategy: &'static str,
    camera: &'static str,
    fps: f64,
    [collection_ms, transfer_ms, defragment_ms]: [Option<f64>; 3],
    active: (u64, u64),
    streamed: (u64, u64),
) -> Streaming {
    let transfer_ms = match transfer_ms {
        Some(ms) => ms,
        None => 0.0,
    };
    Streaming { strategy, camera, fps, collection_ms, transfer_ms, defragment_ms, active, streamed }
}

/// A row of Table 2: a whole frame.
#[derive(Debug)]
pub struct Frame {
    /// The model and the camera setting.
    pub run: &'static str,
    /// Frames per second.
    pub fps: f64,
    /// Milliseconds for selection, streaming, reforming and rendering.
    pub ms: [Option<f64>; 4],
    /// Their shares of the frame in per cent.
    pub shares: [Option<f64>; 4],
    /// Triangles and vertices drawn.
    pub active: (u64, u64),
}

/// Table 2. Of the Boeing's second row two numbers are misprints: the triangles are 17,373,329 in Table 1, and the time
/// for rendering repeats that for reforming, where its share of 22.62 % makes it 41.3 ms.
pub const FRAMES: [Frame; 4] = [
    Frame {
        run: "Boeing 777 (a)",
        fps: 14.0,
        ms: [Some(23.82), Some(38.44), Some(9.6), Some(4.64)],
        shares: [Some(31.14), Some(50.25), Some(12.55), Some(6.07)],
        active: A,
    },
    Frame {
        run: "Boeing 777 (b)",
        fps: 6.0,
        ms: [Some(19.14), Some(87.02), Some(35.05), Some(35.05)],
        shares: [Some(10.49), Some(47.68), Some(19.21), Some(22.62)],
        active: (17_377_329, 14_501_553),
    },
    Frame {
        run: "Power Plant (c)",
        fps: 110.0,
        ms: [Some(4.79), None, Some(1.75), Some(2.86)],
        shares: [Some(50.96), None, Some(18.62), Some(30.43)],
        active: (451_355, 244_699),
    },
    Frame {
        run: "Power Plant (d)",
        fps: 39.0,
        ms: [Some(6.46), None, Some(15.23), Some(3.81)],
        shares: [Some(25.33), None, Some(59.73), Some(14.94)],
        active: (2_790_689, 1_314_593),
    },
];

/// The paper's name of a strategy of ours.
pub fn name_of(strategy: &str) -> &'static str {
    match strategy {
        "coherent" => "SC",
        "whole" => "SnC",
        "per-part" => "NS",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text of the paper names these quotients of times, cut after two decimals, and shares of triangles.
    #[test]
    fn the_numbers_agree_with_what_the_paper_derives_from_them() {
        let total = |row: &Streaming| {
            row.collection_ms.unwrap_or(0.0) + row.transfer_ms + row.defragment_ms.unwrap_or(0.0)
        };
        let over_coherent = |row: usize| total(&STREAMING[row]) / total(&STREAMING[row % 2]);
        let quotients = [2, 3, 4, 5].map(|row| (100.0 * over_coherent(row)).floor() / 100.0);
        assert_eq!(quotients, [1.96, 2.39, 19.83, 4.82]);
        let shares =
            [0, 1].map(|row| 1e5 * STREAMING[row].streamed.0 as f64 / STREAMING[row].active.0 as f64);
        assert_eq!(shares.map(f64::round), [40.0, 38.0]);
        // Table 2 has the same times of streaming.
        assert_eq!([0, 1].map(|row| total(&STREAMING[row])), [0, 1].map(|row| FRAMES[row].ms[1].unwrap()));
        // And the shares are of the sum, to a hundredth, but for the misprint, which is 41.27 by its share.
        for (number, frame) in FRAMES.iter().enumerate() {
            let mut ms = frame.ms.map(|ms| ms.unwrap_or(0.0));
            if number == 1 {
                ms[3] = 41.27;
            }
            let total: f64 = ms.iter().sum();
            for (ms, share) in ms.into_iter().zip(frame.shares) {
                assert!((100.0 * ms / total - share.unwrap_or(0.0)).abs() < 0.015, "{}", frame.run);
            }
        }
    }
}
