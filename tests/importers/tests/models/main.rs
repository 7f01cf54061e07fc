//! Models by other people and programs, in all importers.

mod assimp;
mod damage;
mod limits;
mod needs;
mod same_model;
