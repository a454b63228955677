//! What an agent keeps of what it saw: where it is, where it can walk, and what stands where. It knows its frames and its own
//! moves, and nothing else of the simulator. Poses are in its own frame: it starts in cell (0, 0) and faces north; heights are
//! in metres above the floor.

pub(crate) mod percept;
