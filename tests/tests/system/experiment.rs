//! Written when the robots are there.
