//! Meshes in, one after another as they are read; the same meshes out in any order: kept in memory as long as they are
//! few, and from then on in a file without a name, so that a model need not fit the memory to be baked.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use parking_lot::Mutex;
use xxhash_rust::xxh3::Xxh3;

use super::tint::multiply;
use super::{Colour, Problem, SourceMesh, index_of};

/// Where the meshes of a model are kept, from however many files it is read.
#[derive(Debug, Clone)]
pub struct Room {
    walls: Arc<Walls>,
    stop: Arc<AtomicBool>,
}

#[derive(Debug)]
struct Walls {
    /// How many bytes of meshes may be in memory, and how many more.
    bytes: u64,
    free: AtomicU64,
    cap_bytes: Option<u64>,
    folder: PathBuf,
    /// Made when it is first needed; the system deletes it when the program ends, in whatever way.
    file: Mutex<Option<Arc<Mutex<File>>>>,
}

impl Default for Room {
    /// As much memory as is needed.
    fn default() -> Self {
        Self::new(u64::MAX, None, Path::new("."))
    }
}

impl Room {
    /// Room for so many bytes of meshes in memory, and on the disk of a folder for the rest. What a format cannot do
    /// without may take `cap_bytes` of memory.
    pub fn new(bytes: u64, cap_bytes: Option<u64>, folder: &Path) -> Self {
        let free = AtomicU64::new(bytes);
        let walls = Walls { bytes, free, cap_bytes, folder: folder.to_owned(), file: Mutex::default() };
        Self { walls: Arc::new(walls), stop: Arc::default() }
    }

    /// The same room, with a flag that ends reading once it is set.
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop, ..self }
    }

    /// The flag that ends reading once it is set.
    pub(super) fn stop(&self) -> &Arc<AtomicBool> {
        &self.stop
    }

    /// That something which must be in memory while a file is read is within the cap.
    ///
    /// # Errors
    /// [`Problem::TooLittleMemory`].
    pub(super) fn check(&self, need_bytes: u64, what: &'static str) -> Result<(), Problem> {
        match self.walls.cap_bytes {
            Some(cap_bytes) if need_bytes > cap_bytes => {
                Err(Problem::TooLittleMemory { cap_bytes, need_bytes, what })
            }
            _ => Ok(()),
        }
    }

    /// Takes so many bytes, if they are free.
    fn take(&self, bytes: u64) -> bool {
        let taken = |free: u64| free.checked_sub(bytes);
        self.walls.free.fetch_update(Ordering::Relaxed, Ordering::Relaxed, taken).is_ok()
    }

    /// A file on the disk for what does not fit the memory; it has no name, and the system deletes it when it is closed.
    pub(super) fn file(&self) -> io::Result<File> {
        tempfile::tempfile_in(&self.walls.folder)
    }

    fn keep(&self, mesh: SourceMesh) -> Result<Place, Problem> {
        if self.take(bytes_of(&mesh)) {
            return Ok(Place::Held(Arc::new(mesh)));
        }
        self.put_away(&mesh).map(Place::Away).map_err(Problem::Shelve)
    }

    fn put_away(&self, mesh: &SourceMesh) -> io::Result<Region> {
        let mut made = self.walls.file.lock();
        let shared = match &*made {
            Some(file) => Arc::clone(file),
            None => Arc::new(Mutex::new(self.file()?)),
        };
        *made = Some(Arc::clone(&shared));
        let mut bytes = Vec::with_capacity(bytes_of(mesh) as usize);
        lists_of(mesh).iter().for_each(|list| bytes.extend_from_slice(list));
        let mut file = shared.lock();
        let offset = file.seek(SeekFrom::End(0))?;
        file.write_all(&bytes)?;
        drop(file);
        let counts = [mesh.positions.len(), mesh.normals.len(), mesh.triangles.len(), mesh.colours.len()];
        Ok(Region { file: shared, offset, counts })
    }
}

/// The part of a room that something else than meshes takes as long as it lives.
#[derive(Debug)]
pub(super) struct Share {
    room: Room,
    bytes: u64,
}

impl Share {
    /// Nothing of a room.
    pub fn new(room: &Room) -> Self {
        Self { room: room.clone(), bytes: 0 }
    }

    /// The room that it is of.
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// Takes so many more bytes, if they are free.
    pub fn take(&mut self, bytes: u64) -> bool {
        let is_taken = self.room.take(bytes);
        self.bytes += if is_taken { bytes } else { 0 };
        is_taken
    }

    /// The same for what may as well be on the disk: under a cap it does not take the memory of what may not.
    pub fn take_spare(&mut self, bytes: u64) -> bool {
        self.room.walls.cap_bytes.is_none() && self.take(bytes)
    }

    /// Bytes that everything else in the room takes.
    pub fn others(&self) -> u64 {
        self.room.walls.bytes - self.room.walls.free.load(Ordering::Relaxed) - self.bytes
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.room.walls.free.fetch_add(self.bytes, Ordering::Relaxed);
    }
}

/// Its lists, in the order in which they are put away.
fn lists_of(mesh: &SourceMesh) -> [&[u8]; 4] {
    [
        bytemuck::cast_slice(&mesh.positions),
        bytemuck::cast_slice(&mesh.normals),
        bytemuck::cast_slice(&mesh.triangles),
        bytemuck::cast_slice(&mesh.colours),
    ]
}

fn bytes_of(mesh: &SourceMesh) -> u64 {
    lists_of(mesh).iter().map(|list| list.len() as u64).sum()
}

/// The meshes of a model, by number.
#[derive(Debug, Default)]
pub struct Shelf {
    room: Room,
    meshes: Vec<Shelved>,
}

/// What is known of a mesh on the shelf.
#[derive(Debug)]
pub struct Shelved {
    /// As [`SourceMesh::name`].
    pub name: String,
    /// As [`SourceMesh::body`].
    pub body: u32,
    /// How many triangles it has.
    pub triangles: u64,
    /// Whether its vertices have colours.
    pub is_coloured: bool,
    /// What its colours are to be multiplied by.
    pub(super) tint: Option<Colour>,
    /// Of its lists.
    hash: u64,
    place: Mutex<Place>,
}

#[derive(Debug, Clone, Default)]
enum Place {
    Held(Arc<SourceMesh>),
    Away(Region),
    #[default]
    Given,
}

/// Where in the file the lists of a mesh lie, and how long they are.
#[derive(Debug, Clone)]
struct Region {
    file: Arc<Mutex<File>>,
    offset: u64,
    counts: [usize; 4],
}

impl Region {
    fn read(&self) -> io::Result<SourceMesh> {
        let [positions, normals, triangles, colours] = self.counts;
        let mut mesh = SourceMesh {
            positions: vec![[0.0; 3]; positions],
            normals: vec![[0.0; 3]; normals],
            triangles: vec![[0; 3]; triangles],
            colours: vec![[0; 4]; colours],
            ..SourceMesh::default()
        };
        let mut file = self.file.lock();
        file.seek(SeekFrom::Start(self.offset))?;
        file.read_exact(bytemuck::cast_slice_mut(&mut mesh.positions))?;
        file.read_exact(bytemuck::cast_slice_mut(&mut mesh.normals))?;
        file.read_exact(bytemuck::cast_slice_mut(&mut mesh.triangles))?;
        file.read_exact(bytemuck::cast_slice_mut(&mut mesh.colours))?;
        Ok(mesh)
    }
}

impl Shelved {
    /// One that is nowhere yet; takes the name of the mesh.
    fn of(mesh: &mut SourceMesh) -> Self {
        let mut hash = Xxh3::new();
        lists_of(mesh).iter().for_each(|list| hash.update(list));
        Self {
            name: std::mem::take(&mut mesh.name),
            body: mesh.body,
            triangles: mesh.triangles.len() as u64,
            is_coloured: !mesh.colours.is_empty(),
            tint: None,
            hash: hash.digest(),
            place: Mutex::default(),
        }
    }

    /// What makes it another mesh.
    pub(crate) fn update(&self, hash: &mut Xxh3) {
        hash.update(self.name.as_bytes());
        hash.update(&self.body.to_le_bytes());
        hash.update(&self.tint.unwrap_or_default());
        hash.update(&self.hash.to_le_bytes());
    }
}

impl Shelf {
    /// An empty shelf in a room.
    pub fn new(room: &Room) -> Self {
        Self { room: room.clone(), ..Self::default() }
    }

    /// Meshes that are in memory, and stay there.
    pub fn of(meshes: Vec<SourceMesh>) -> Self {
        let held = |mut mesh: SourceMesh| {
            let shelved = Shelved::of(&mut mesh);
            Shelved { place: Mutex::new(Place::Held(Arc::new(mesh))), ..shelved }
        };
        Self { meshes: meshes.into_iter().map(held).collect(), ..Self::default() }
    }

    /// The room that it is in.
    pub(super) fn room(&self) -> &Room {
        &self.room
    }

    /// What is known of all meshes.
    pub fn meshes(&self) -> &[Shelved] {
        &self.meshes
    }

    /// The same, to be changed.
    pub(super) fn meshes_mut(&mut self) -> &mut [Shelved] {
        &mut self.meshes
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.meshes.len()
    }

    /// Puts a mesh behind the others; gives its number.
    ///
    /// # Errors
    /// [`Problem::TooMany`], [`Problem::Interrupted`], and [`Problem::Shelve`] if the disk refuses it.
    pub(super) fn push(&mut self, mut mesh: SourceMesh) -> Result<u32, Problem> {
        if self.room.stop.load(Ordering::Relaxed) {
            return Err(Problem::Interrupted);
        }
        let number = index_of(self.meshes.len())?;
        let shelved = Shelved::of(&mut mesh);
        let place = Mutex::new(self.room.keep(mesh)?);
        self.meshes.push(Shelved { place, ..shelved });
        Ok(number)
    }

    /// The number of another mesh that is the same, and takes no room.
    ///
    /// # Errors
    /// [`Problem::TooMany`].
    pub(super) fn repeat(&mut self, mesh: u32) -> Result<u32, Problem> {
        let number = index_of(self.meshes.len())?;
        let shelved = &self.meshes[mesh as usize];
        let (name, place) = (shelved.name.clone(), Mutex::new(shelved.place.lock().clone()));
        self.meshes.push(Shelved { name, place, ..*shelved });
        Ok(number)
    }

    /// Puts the meshes of another shelf behind these.
    pub(super) fn append(&mut self, other: Self) {
        let base = self.meshes.len() as u32;
        let moved = other.meshes.into_iter().map(|mesh| Shelved { body: base + mesh.body, ..mesh });
        self.meshes.extend(moved);
    }

    /// Gives a mesh away; whoever asks for it again gets one of no triangles.
    ///
    /// # Errors
    /// [`Problem::Shelve`] if it cannot be read back.
    pub fn give(&self, number: usize) -> Result<SourceMesh, Problem> {
        let shelved = &self.meshes[number];
        let place = std::mem::take(&mut *shelved.place.lock());
        let mut mesh = match place {
            Place::Held(mesh) => Arc::unwrap_or_clone(mesh),
            Place::Away(region) => region.read().map_err(Problem::Shelve)?,
            Place::Given => SourceMesh::default(),
        };
        if let Some(tint) = shelved.tint {
            multiply(&mut mesh.colours, tint);
        }
        Ok(SourceMesh { name: shelved.name.clone(), body: shelved.body, ..mesh })
    }

    /// Bytes of meshes in memory.
    pub fn bytes_held(&self) -> u64 {
        let held = |mesh: &Shelved| match &*mesh.place.lock() {
            Place::Held(mesh) => bytes_of(mesh) / Arc::strong_count(mesh) as u64,
            Place::Away(_) | Place::Given => 0,
        };
        self.meshes.iter().map(held).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(name: &str, vertices: usize) -> SourceMesh {
        SourceMesh {
            name: name.to_owned(),
            body: 0,
            positions: (0..vertices).map(|i| [i as f32, 1.0, -2.0]).collect(),
            normals: vec![[0.0, 0.0, 1.0]; vertices],
            colours: vec![[200, 100, 50, 255]; vertices],
            triangles: vec![[0, 1, 2]; 2 * vertices],
            slots: Vec::new(),
        }
    }

    #[test]
    fn what_is_put_away_comes_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let all = [mesh("a", 3), mesh("b", 1000), mesh("c", 30)];
        for free in [0, 10_000, u64::MAX] {
            let mut shelf = Shelf::new(&Room::new(free, None, folder.path()));
            for mesh in &all {
                shelf.push(mesh.clone()).unwrap();
            }
            assert!(shelf.bytes_held() <= free);
            assert_eq!(shelf.bytes_held() > 0, free > 0, "{free}");
            for number in [2, 0, 1] {
                assert_eq!(shelf.give(number).unwrap(), all[number], "{number} of {free}");
            }
            assert_eq!(shelf.give(1).unwrap().triangles.len(), 0);
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the file has a name");
    }

    #[test]
    fn a_repeated_mesh_has_a_tint_of_its_own() {
        for free in [0, u64::MAX] {
            let folder = tempfile::tempdir().unwrap();
            let mut shelf = Shelf::new(&Room::new(free, None, folder.path()));
            shelf.push(mesh("a", 3)).unwrap();
            let again = shelf.repeat(0).unwrap() as usize;
            shelf.meshes_mut()[again].tint = Some([255, 0, 255, 255]);
            assert_eq!(shelf.give(0).unwrap(), mesh("a", 3));
            assert_eq!(shelf.give(again).unwrap().colours, [[200, 0, 50, 255]; 3]);
        }
    }

    #[test]
    fn nothing_is_read_once_the_flag_is_set() {
        let stop = Arc::new(AtomicBool::new(false));
        let room = Room::default().stopped_by(Arc::clone(&stop));
        let mut shelf = Shelf::new(&room);
        shelf.push(mesh("a", 3)).unwrap();
        stop.store(true, Ordering::Relaxed);
        assert!(matches!(shelf.push(mesh("b", 3)), Err(Problem::Interrupted)));
        for packed in ["a.ply", "a.ply.gz", "a.ply.zst"] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(packed);
            std::fs::write(&path, [0x1f, 0x8b, 8, 0]).unwrap();
            let error = crate::import::read_into(&[path], &room).unwrap_err().to_string();
            assert!(error.starts_with("interrupted: "), "{packed}: {error}");
        }
    }

    #[test]
    fn a_disk_that_refuses_is_an_error() {
        let mut shelf = Shelf::new(&Room::new(0, None, Path::new("no/such/folder")));
        let message = shelf.push(mesh("a", 3)).unwrap_err().to_string();
        assert!(message.contains("cannot put a mesh away"), "{message}");
    }
}
