//! Faces in, in the order of the text; the faces of one chunk after another out.
//!
//! A chunk may come back anywhere in the text, so no mesh can be built before its end. Until then the faces stay in one
//! list of runs, each of one chunk, the end of it in memory and the rest in a file without a name.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use rustc_hash::FxHashMap;

use super::vertices::Corner;
use crate::import::shelf::{Room, Share};

/// So many words of faces are gathered before they go to the disk.
const GATHERED_WORDS: usize = 4 << 20;

/// A run that has as many words ends with the next face, so that runs are read back in small pieces.
const RUN_WORDS: u32 = 1 << 16;

/// Which object, group and material faces belong to, as numbers of names; 0 stands for none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Chunk {
    /// The `o` line in force.
    pub object: u32,
    /// The `g` line in force.
    pub group: u32,
    /// The `usemtl` line in force.
    pub material: u32,
}

/// What is known of the faces of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gathered {
    /// The chunk.
    pub chunk: Chunk,
    /// Whether all corners have a normal with a direction.
    pub with_normals: bool,
    /// How many triangles its faces are cut into.
    pub triangles: u64,
}

/// Faces of one chunk that are side by side in the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Run {
    chunk: u32,
    words: u32,
    start: u64,
}

/// All faces of a text.
///
/// A face is a word with twice its number of corners, plus one if they have normals; then the positions of its corners;
/// then their normals.
pub struct Faces {
    chunks: Vec<Gathered>,
    numbers: FxHashMap<Chunk, u32>,
    runs: Vec<Run>,
    /// The words after those on the disk, and how many these are.
    words: Vec<u32>,
    words_away: u64,
    file: Option<File>,
    share: Share,
    most_words: usize,
}

impl Faces {
    /// No faces, in a room.
    pub fn new(room: &Room) -> Self {
        Self {
            chunks: Vec::new(),
            numbers: FxHashMap::default(),
            runs: Vec::new(),
            words: Vec::new(),
            words_away: 0,
            file: None,
            share: Share::new(room),
            most_words: GATHERED_WORDS,
        }
    }

    /// Adds a face to a chunk; `with_normals` tells whether all its corners have one with a direction.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn add(&mut self, chunk: Chunk, corners: &[Corner], with_normals: bool) -> io::Result<()> {
        if self.words.len() >= self.most_words {
            self.make_room()?;
        }
        let number = self.number_of(chunk);
        let gathered = &mut self.chunks[number as usize];
        gathered.with_normals &= with_normals;
        gathered.triangles += corners.len().saturating_sub(2) as u64;
        let with_normals = gathered.with_normals;
        let before = self.words.len();
        self.words.push((corners.len() as u32) << 1 | u32::from(with_normals));
        self.words.extend(corners.iter().map(|corner| corner.position));
        if with_normals {
            self.words.extend(corners.iter().map(|corner| corner.normal));
        }
        self.lengthen(number, before);
        Ok(())
    }

    /// The number of a chunk, in the order of their first faces.
    fn number_of(&mut self, chunk: Chunk) -> u32 {
        let last = self.runs.last().map(|run| run.chunk);
        if let Some(last) = last.filter(|&last| self.chunks[last as usize].chunk == chunk) {
            return last;
        }
        let next = self.chunks.len() as u32;
        let number = *self.numbers.entry(chunk).or_insert(next);
        if number == next {
            self.chunks.push(Gathered { chunk, with_normals: true, triangles: 0 });
        }
        number
    }

    /// Makes the words from `before` on part of a run of the chunk.
    fn lengthen(&mut self, chunk: u32, before: usize) {
        let words = (self.words.len() - before) as u32;
        match self.runs.last_mut().filter(|run| before > 0 && run.chunk == chunk && run.words < RUN_WORDS) {
            Some(run) => run.words += words,
            None => self.runs.push(Run { chunk, words, start: self.words_away + before as u64 }),
        }
    }

    /// Lets the words in memory become more, or puts them away.
    fn make_room(&mut self) -> io::Result<()> {
        if self.share.take_spare(4 * GATHERED_WORDS as u64) {
            self.most_words += GATHERED_WORDS;
            return Ok(());
        }
        let mut file = match self.file.take() {
            Some(file) => file,
            None => self.share.room().file()?,
        };
        file.write_all(bytemuck::cast_slice(&self.words))?;
        self.file = Some(file);
        self.words_away += self.words.len() as u64;
        self.words.clear();
        Ok(())
    }

    /// All chunks that have faces, in the order of their first face.
    pub fn chunks(&self) -> &[Gathered] {
        &self.chunks
    }

    /// Bytes of what is known of runs.
    pub fn bytes(&self) -> u64 {
        (self.runs.len() * size_of::<Run>()) as u64
    }

    /// Gives the runs of every chunk, chunk by chunk and each in the order of the text.
    pub fn by_chunk(&mut self) -> impl Iterator<Item = (Gathered, Runs<'_>)> {
        self.runs.sort_unstable_by_key(|run| (run.chunk, run.start));
        let Self { chunks, runs, words, words_away, file, .. } = self;
        let of_chunks = runs.chunk_by(|a, b| a.chunk == b.chunk);
        let (words, file) = (&words[..], file.as_ref());
        chunks.iter().zip(of_chunks).map(move |(&gathered, runs)| {
            (gathered, Runs { runs, words, words_away: *words_away, file, piece: Vec::new() })
        })
    }
}

/// The runs of one chunk.
pub struct Runs<'a> {
    runs: &'a [Run],
    words: &'a [u32],
    words_away: u64,
    file: Option<&'a File>,
    /// A run that was on the disk.
    piece: Vec<u32>,
}

impl Runs<'_> {
    /// The faces of the next run; `None` after the last.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn advance(&mut self) -> io::Result<Option<FacesOf<'_>>> {
        let Some((run, rest)) = self.runs.split_first() else { return Ok(None) };
        self.runs = rest;
        let words = run.words as usize;
        if let Some(start) = run.start.checked_sub(self.words_away) {
            return Ok(Some(FacesOf(&self.words[start as usize..][..words])));
        }
        self.piece.resize(words, 0);
        let mut file = self.file.ok_or(io::ErrorKind::NotFound)?;
        file.seek(SeekFrom::Start(4 * run.start))?;
        file.read_exact(bytemuck::cast_slice_mut(&mut self.piece))?;
        Ok(Some(FacesOf(&self.piece)))
    }
}

/// Faces as they are in the list.
pub struct FacesOf<'a>(&'a [u32]);

impl FacesOf<'_> {
    /// Fills `corners` with those of the next face; `false` after the last.
    pub fn next_into(&mut self, corners: &mut Vec<Corner>) -> bool {
        corners.clear();
        let Some((&head, rest)) = self.0.split_first() else { return false };
        let (positions, rest) = rest.split_at((head >> 1) as usize);
        let corner = |(&position, &normal): (&u32, &u32)| Corner { position, normal };
        if head & 1 == 0 {
            corners.extend(positions.iter().map(|&position| Corner { position, normal: 0 }));
            self.0 = rest;
        } else {
            let (normals, rest) = rest.split_at(positions.len());
            corners.extend(positions.iter().zip(normals).map(corner));
            self.0 = rest;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(first: u32, count: u32, normal: u32) -> Vec<Corner> {
        (first..first + count).map(|position| Corner { position, normal }).collect()
    }

    /// Faces of 3 to 6 corners in chunks that come and go, and the same sorted by chunk.
    fn gather(most_words: usize, folder: &std::path::Path) -> (Faces, Vec<Vec<Vec<Corner>>>) {
        let mut faces = Faces::new(&Room::new(0, Some(0), folder));
        faces.most_words = most_words;
        let mut expected = vec![Vec::new(); 5];
        for i in 0..1000 {
            // The first to come is the first of all, then 1 to 4.
            let object = (i * i / 7) % 5;
            let face = corners(1 + i, 3 + i % 4, 1 + i % 2);
            faces.add(Chunk { object, ..Chunk::default() }, &face, object != 3 || i < 500).unwrap();
            expected[object as usize].push(face);
        }
        let order: Vec<_> = faces.chunks().iter().map(|gathered| gathered.chunk.object as usize).collect();
        assert_eq!(order.len(), 5);
        (faces, order.iter().map(|&object| std::mem::take(&mut expected[object])).collect())
    }

    #[test]
    fn faces_come_back_by_chunk_from_memory_and_disk() {
        let folder = tempfile::tempdir().unwrap();
        for most_words in [1, 100, 3000, usize::MAX] {
            let (mut faces, expected) = gather(most_words, folder.path());
            assert_eq!(faces.file.is_some(), most_words < usize::MAX, "{most_words}");
            assert!(faces.words.len() <= most_words.saturating_add(20));
            for ((gathered, mut runs), expected) in faces.by_chunk().zip(expected) {
                let triangles: usize = expected.iter().map(|face| face.len() - 2).sum();
                assert_eq!(gathered.triangles, triangles as u64);
                assert_eq!(gathered.with_normals, gathered.chunk.object != 3);
                let (mut given, mut face) = (Vec::new(), Vec::new());
                while let Some(mut faces) = runs.advance().unwrap() {
                    while faces.next_into(&mut face) {
                        given.push(face.clone());
                    }
                }
                let differ = |(given, expected): (&Vec<Corner>, &Vec<Corner>)| {
                    given != expected && !(given[0].normal == 0 && expected[0].position > 500)
                };
                assert_eq!(given.len(), expected.len());
                assert!(!given.iter().zip(&expected).any(differ), "{most_words}: {:?}", gathered.chunk);
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the file has a name");
    }

    #[test]
    fn a_long_run_is_read_back_in_pieces() {
        let mut faces = Faces::new(&Room::default());
        (0..50_000).for_each(|i| faces.add(Chunk::default(), &corners(1 + i, 3, 0), false).unwrap());
        let (_, mut runs) = faces.by_chunk().next().unwrap();
        let (mut pieces, mut count, mut face) = (0, 0, Vec::new());
        while let Some(mut faces) = runs.advance().unwrap() {
            pieces += 1;
            while faces.next_into(&mut face) {
                count += 1;
                assert_eq!(face, corners(count, 3, 0));
            }
        }
        assert_eq!((pieces, count), (4, 50_000));
    }

    #[test]
    fn a_disk_that_refuses_is_an_error() {
        let mut faces = Faces::new(&Room::new(0, Some(0), std::path::Path::new("no/such/folder")));
        faces.most_words = 1;
        faces.add(Chunk::default(), &corners(1, 3, 0), false).unwrap();
        assert!(faces.add(Chunk::default(), &corners(1, 3, 0), false).is_err());
    }
}
