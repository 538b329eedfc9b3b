//! A second reader, written from `docs/format.md` alone: it takes bytes at stated offsets and none of the crate's types.
//! What it reads from the golden file must be what the crate reads.

use collapsar::container::Container;

use crate::golden::golden;

struct File<'a>(&'a [u8]);

impl File<'_> {
    fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.0[at..at + 2].try_into().unwrap())
    }

    fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.0[at..at + 4].try_into().unwrap())
    }

    fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.0[at..at + 8].try_into().unwrap())
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_bits(self.u64(at))
    }

    fn section(&self, kind: usize) -> usize {
        let row = 64 + 32 * (kind - 1);
        assert_eq!(self.u32(row) as usize, kind);
        self.u64(row + 8) as usize
    }

    fn part(&self, index: usize) -> usize {
        self.section(1) + 128 * index
    }

    fn name(&self, row: usize) -> &str {
        let start = self.section(6) + self.u64(row) as usize;
        std::str::from_utf8(&self.0[start..start + self.u32(row + 8) as usize]).unwrap()
    }
}

/// One tier and all coarser ones, as far as drawing needs them.
#[derive(Default)]
struct Tier {
    triangles: Vec<[u16; 3]>,
    vertices: Vec<[u32; 3]>,
    ecol: Vec<u16>,
    /// How many triangles there are at 0, 1, 2, ... vertices; `None` for a count that is no state.
    triangles_at: Vec<Option<u32>>,
}

fn read_tier(file: &File, part: usize, tier: usize) -> Tier {
    let part = file.part(part);
    let (first, tiers) = (file.u32(part + 88) as usize, file.u32(part + 92) as usize);
    let mut out = Tier { triangles_at: vec![Some(0)], ..Tier::default() };
    let mut total = 0;
    for k in (tier..tiers).rev() {
        let row = file.section(2) + 32 * (first + k);
        let added = file.u32(row + 12) as usize - out.vertices.len();
        let (t, overflow) = (file.u32(row + 16) as usize, file.u32(row + 20) as usize);
        let at = file.u64(row) as usize;
        out.triangles = (0..t).map(|i| [0, 2, 4].map(|corner| file.u16(at + 8 * i + corner))).collect();
        let at = at + 8 * t;
        out.vertices.extend((0..added).map(|i| [0, 4, 8].map(|word| file.u32(at + 12 * i + word))));
        let at = at + 12 * added;
        let mut entries = (0..overflow).map(|i| file.u32(at + 8 * i + 4));
        let at = at + 8 * overflow;
        out.ecol.extend((0..added).map(|i| file.u16(at + 2 * i)));
        let at = at + 2 * added;
        for &byte in &file.0[at..at + added] {
            total += match byte {
                255 => 0,
                254 => entries.next().unwrap(),
                count => u32::from(count),
            };
            out.triangles_at.push((byte != 255).then_some(total));
        }
    }
    out
}

/// The triangles of a state.
fn draw(tier: &Tier, vn: usize) -> Vec<[u16; 3]> {
    let count = tier.triangles_at[vn].expect("a state") as usize;
    let walk = |mut vertex: u16| {
        while usize::from(vertex) >= vn {
            vertex = tier.ecol[usize::from(vertex)];
        }
        vertex
    };
    tier.triangles[..count].iter().map(|t| t.map(walk)).collect()
}

fn position(file: &File, part: usize, words: [u32; 3]) -> [f64; 3] {
    let row = file.part(part);
    let packed = u64::from(words[0]) | u64::from(words[1]) << 32;
    let step = f64::from(file.u32(row + 24) as i32).exp2();
    [0, 1, 2].map(|axis| file.f64(row + 8 * axis) + step * (packed >> (21 * axis) & 0x1f_ffff) as f64)
}

fn normal(words: [u32; 3], coloured: bool) -> [f64; 3] {
    let [x, y] = if coloured {
        [words[2] as u8, (words[2] >> 8) as u8].map(|c| (f64::from(c as i8) / 127.0).max(-1.0))
    } else {
        [words[2] as u16, (words[2] >> 16) as u16].map(|c| (f64::from(c as i16) / 32767.0).max(-1.0))
    };
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    let n = [x + if x >= 0.0 { -t } else { t }, y + if y >= 0.0 { -t } else { t }, z];
    let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
    n.map(|c| c / length)
}

#[test]
fn a_reader_written_from_the_specification_draws_the_same_triangles() {
    let bytes = golden();
    let (file, container) = (File(bytes.get()), Container::open(bytes.get()).unwrap());
    for part in 0..3 {
        let whole = container.read_part(part).unwrap();
        let tiers: Vec<Tier> = (0..whole.tiers.len()).map(|tier| read_tier(&file, part, tier)).collect();
        assert_eq!(file.name(file.part(part) + 72), container.part_name(part));
        for vn in whole.locked as usize..=whole.vertices.len() {
            if !whole.triangles_at.is_state(vn) {
                assert_eq!(tiers[0].triangles_at[vn], None);
                continue;
            }
            let crate_draws =
                crate::parts::reformed(&whole.tiers[0].triangles, &whole.ecol, &whole.triangles_at, vn);
            let crate_draws: Vec<[u16; 3]> = crate_draws.iter().map(|t| t.vertices).collect();
            for tier in tiers.iter().filter(|tier| tier.vertices.len() >= vn) {
                assert_eq!(draw(tier, vn), crate_draws, "part {part} at {vn} vertices");
            }
        }
    }
}

#[test]
fn a_reader_written_from_the_specification_decodes_the_same_vertices() {
    let bytes = golden();
    let (file, container) = (File(bytes.get()), Container::open(bytes.get()).unwrap());
    for part in 0..3 {
        let whole = container.read_part(part).unwrap();
        let tier = read_tier(&file, part, 0);
        let coloured = file.u32(file.part(part) + 28) & 1 != 0;
        for (words, vertex) in tier.vertices.iter().zip(&whole.vertices) {
            assert_eq!(position(&file, part, *words), whole.grid.position(vertex.grid()));
            let expected = vertex.normal(whole.attributes);
            for (axis, c) in normal(*words, coloured).into_iter().enumerate() {
                assert!((c - f64::from(expected[axis])).abs() < 1e-5, "{words:?}");
            }
        }
    }
}

#[test]
fn a_reader_written_from_the_specification_places_the_same_instances() {
    let bytes = golden();
    let (file, container) = (File(bytes.get()), Container::open(bytes.get()).unwrap());
    for (index, instance) in container.instances().iter().enumerate() {
        let row = file.section(3) + 112 * index;
        assert_eq!([0, 4, 8].map(|at| file.u32(row + at)), [instance.part, instance.node, instance.material]);
        let p = [1.0, 10.0, 100.0];
        let column = |axis: usize, c: usize| file.f64(row + 16 + 8 * (3 * c + axis));
        let world =
            [0, 1, 2].map(|axis| (0..3).map(|c| column(axis, c) * p[c]).sum::<f64>() + column(axis, 3));
        assert_eq!(world, instance.transform().transform_point3(p.into()).to_array());
    }
    let node = file.section(4) + 16;
    assert_eq!((file.name(node), file.u32(node + 12)), ("cylinder ø 20", 0));
    let material = file.section(5) + 16;
    assert_eq!(
        (file.name(material), &file.0[material + 12..material + 16]),
        ("steel", &[90, 91, 92, 255][..])
    );
}
