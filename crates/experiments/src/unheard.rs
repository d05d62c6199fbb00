//! Words of measures and expectations that occur in no run of an experiment. They may be misspelled: then numbers of them are 0, and
//! nothing else shows it.

use std::collections::BTreeMap;

use observe::words::Word;

use super::unit::Played;

/// The words that did not occur in units.
#[derive(Debug, Default)]
pub(super) struct MissingWords {
    /// Number of units.
    units: usize,
    /// For each word, in how many units it did not occur, and one like it that did occur.
    words: BTreeMap<Word, (usize, Option<String>)>,
}

impl MissingWords {
    pub(super) fn add(&mut self, played: &Played) {
        self.units += 1;
        for unheard in &played.unheard {
            let (count, like) = self.words.entry(unheard.word.clone()).or_default();
            *count += 1;
            if like.is_none() {
                like.clone_from(&unheard.like);
            }
        }
    }

    /// Those that occurred in none of the units, in words.
    pub(super) fn in_all(self) -> Vec<String> {
        let mut sentences = Vec::new();
        for (word, (count, like)) in self.words {
            if count < self.units {
                continue;
            }
            let mut sentence = format!("{word} never occurred in any run");
            if let Some(like) = like {
                sentence += &format!("; did you mean {like}?");
            }
            sentences.push(sentence);
        }
        sentences
    }
}
