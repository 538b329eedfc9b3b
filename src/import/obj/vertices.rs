//! The vertices of an OBJ text in, tables of them out: what any face may refer to, so they stay in memory until the last
//! one is read.

use crate::import::attributes::{WHITE, channel, unit};
use crate::import::notes::quoted;
use crate::import::shelf::{Room, Share};
use crate::import::{Colour, Problem, index_of};

/// What reading takes beside the tables: the program and what is gathered of faces.
const BYTES_AT_LEAST: u64 = 32 << 20;

/// The tables take their share of the room in steps of so many bytes.
const STEP_BYTES: u64 = 1 << 20;

/// Positions, normals and colours, each counted from 1 by the faces.
pub struct Vertices {
    positions: Vec<[f32; 3]>,
    /// At length 1, or zero for one without direction.
    normals: Vec<[f32; 3]>,
    /// One for each position, or none as long as no vertex has one.
    colours: Vec<Colour>,
    share: Share,
    /// Bytes of the tables that were looked for in the room.
    granted: u64,
}

/// A corner of a face: its position and its normal, counted from 1; normal 0 for none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Corner {
    /// Of the table of positions.
    pub position: u32,
    /// Of the table of normals.
    pub normal: u32,
}

impl Vertices {
    /// Empty tables in a room.
    pub fn new(room: &Room) -> Self {
        let share = Share::new(room);
        Self { positions: Vec::new(), normals: Vec::new(), colours: Vec::new(), share, granted: 0 }
    }

    /// Adds the vertex of a `v` line: three numbers, which a weight may follow, a colour, or both.
    ///
    /// # Errors
    /// In words, that there are no three numbers, or that there are too many vertices.
    pub fn add_position(&mut self, rest: &str) -> Result<(), String> {
        let (numbers, count) = leading_numbers(rest)?;
        index_of(self.positions.len()).map_err(|problem| problem.to_string())?;
        let [mut x, mut y, mut z, ..] = numbers;
        let (weight, colour) = match count {
            4 | 5 => (numbers[3], None),
            6 => (1.0, Some([numbers[3], numbers[4], numbers[5]])),
            7 => (numbers[3], Some([numbers[4], numbers[5], numbers[6]])),
            _ => (1.0, None),
        };
        if weight != 1.0 && weight != 0.0 {
            [x, y, z] = [x / weight, y / weight, z / weight];
        }
        self.add_colour(colour);
        self.positions.push([x, y, z]);
        Ok(())
    }

    /// Once a vertex has a colour all have one: white, if nothing else is said.
    fn add_colour(&mut self, colour: Option<[f32; 3]>) {
        if colour.is_none() && self.colours.is_empty() {
            return;
        }
        self.colours.resize(self.positions.len(), WHITE);
        let [r, g, b] = in_unit_range(colour.unwrap_or([1.0; 3])).map(channel);
        self.colours.push([r, g, b, 255]);
    }

    /// Adds the normal of a `vn` line.
    ///
    /// # Errors
    /// As [`Self::add_position`].
    pub fn add_normal(&mut self, rest: &str) -> Result<(), String> {
        let ([x, y, z, ..], _) = leading_numbers(rest)?;
        index_of(self.normals.len()).map_err(|problem| problem.to_string())?;
        self.normals.push(unit([x, y, z]).unwrap_or_default());
        Ok(())
    }

    /// The place of a position in the table, from 1; `None` if there is none.
    pub fn position_at(&self, field: &str) -> Option<u32> {
        absolute(field, self.positions.len())
    }

    /// The place of a normal in the table, from 1; `None` if there is none.
    pub fn normal_at(&self, field: &str) -> Option<u32> {
        absolute(field, self.normals.len())
    }

    /// The position of a corner.
    pub fn position(&self, corner: Corner) -> [f32; 3] {
        self.positions[corner.position as usize - 1]
    }

    /// The unit normal of a corner; `None` if it has none, or one without direction.
    pub fn normal(&self, corner: Corner) -> Option<[f32; 3]> {
        let normal = self.normals[(corner.normal as usize).checked_sub(1)?];
        (normal != [0.0; 3]).then_some(normal)
    }

    /// The colour of a corner.
    pub fn colour(&self, corner: Corner) -> Colour {
        self.colours.get(corner.position as usize - 1).copied().unwrap_or(WHITE)
    }

    fn bytes(&self) -> u64 {
        let lists = [self.positions.len() * 12, self.normals.len() * 12, self.colours.len() * 4];
        lists.iter().sum::<usize>() as u64
    }

    /// Takes room for what was added.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn settle(&mut self) -> Result<(), Problem> {
        while self.bytes() > self.granted {
            self.granted += STEP_BYTES;
            // Where there is no room left for meshes, the cap alone counts.
            self.share.take(STEP_BYTES);
            self.check(0)?;
        }
        Ok(())
    }

    /// That reading can be done within the cap, with so many more bytes than there are now.
    ///
    /// # Errors
    /// [`Problem::TooLittleMemory`].
    pub fn check(&self, more_bytes: u64) -> Result<(), Problem> {
        let need_bytes = self.share.others() + self.bytes() + BYTES_AT_LEAST + more_bytes;
        self.share.room().check(need_bytes, "reading the vertices of OBJ text takes")
    }
}

/// Up to seven leading numbers of a line, and how many there are: at least three.
fn leading_numbers(rest: &str) -> Result<([f32; 7], usize), String> {
    let mut numbers = [0.0; 7];
    let mut count = 0;
    for (slot, word) in numbers.iter_mut().zip(rest.split_ascii_whitespace()) {
        match word.parse() {
            Ok(number) => *slot = number,
            Err(_) if count < 3 && !word.starts_with('#') => {
                return Err(format!("{} is not a number", quoted(word)));
            }
            Err(_) => break,
        }
        count += 1;
    }
    if count < 3 {
        Err(format!("three numbers are needed, but there are {count}"))
    } else {
        Ok((numbers, count))
    }
}

/// Colours are meant to be in 0..1, but some programs write 0..255.
fn in_unit_range(colour: [f32; 3]) -> [f32; 3] {
    if colour.iter().any(|&c| c > 1.0) { colour.map(|c| c / 255.0) } else { colour }
}

/// An index counted from 1, or backwards from -1, as one counted from 1; `None` if there is no such element.
fn absolute(field: &str, count: usize) -> Option<u32> {
    let (index, count): (i64, i64) = (field.parse().ok()?, count as i64);
    let absolute = if index < 0 { count.checked_add(index)?.checked_add(1)? } else { index };
    (1..=count).contains(&absolute).then_some(absolute as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> (Vec<[f32; 3]>, Vec<Colour>) {
        let mut vertices = Vertices::new(&Room::default());
        lines.iter().for_each(|line| vertices.add_position(line).unwrap());
        let corners = (1..=lines.len() as u32).map(|position| Corner { position, normal: 0 });
        corners.map(|corner| (vertices.position(corner), vertices.colour(corner))).unzip()
    }

    #[test]
    fn what_follows_three_numbers_is_a_weight_or_a_colour_or_both() {
        let (positions, colours) =
            read(&["0 0 0", "1 0 0 1 0.5 0.25 0", "0 1 0 255 0 51", "4 2 0 2", "3 0 0 # 2", "1 2 3 0"]);
        let expected =
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 1.0, 0.0], [3.0, 0.0, 0.0], [1.0, 2.0, 3.0]];
        assert_eq!(positions, expected);
        assert_eq!(colours, [WHITE, [128, 64, 0, 255], [255, 0, 51, 255], WHITE, WHITE, WHITE]);
    }

    #[test]
    fn normals_have_length_one_or_count_as_none() {
        let mut vertices = Vertices::new(&Room::default());
        ["0 0 2", "0 0 0", "nan 0 1"].iter().for_each(|line| vertices.add_normal(line).unwrap());
        let normals = [0, 1, 2, 3].map(|normal| vertices.normal(Corner { position: 1, normal }));
        assert_eq!(normals, [None, Some([0.0, 0.0, 1.0]), None, None]);
    }

    #[test]
    fn the_room_gets_back_what_tables_took() {
        let room = Room::new(10 << 20, None, std::path::Path::new("."));
        let mut vertices = Vertices::new(&room);
        for _ in 0..1 << 18 {
            vertices.add_position("1 2 3").unwrap();
            vertices.settle().unwrap();
        }
        let outside = Share::new(&room);
        assert_eq!(outside.others(), 3 << 20);
        drop(vertices);
        assert_eq!(outside.others(), 0);
    }
}
