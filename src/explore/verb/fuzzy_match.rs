//! The verbs that can be typed, and how a few letters find one.

/// A verb as it is typed.
pub struct Said {
    /// Its first word.
    pub name: &'static str,
    /// What may follow.
    pub arguments: &'static str,
    /// One line for palette and help.
    pub doc: &'static str,
}

const fn said(name: &'static str, arguments: &'static str, doc: &'static str) -> Said {
    Said { name, arguments, doc }
}

/// Every verb that can be typed, in the palette or in plain mode.
pub const SAID: &[Said] = &[
    said("run", "", "go on (replay, then the policy), or pause"),
    said("continue", "", "let the policy act from here"),
    said("step", "[N]", "N steps as the policy chooses (1)"),
    said("do", "N|ACTION", "interaction N of the list, or MoveAhead, RotateLeft, ..."),
    said("instruct", "TEXT", "tell the agent something else"),
    said("back", "[N]", "N steps back (1)"),
    said("forward", "[N]", "N steps forward along the branch (1)"),
    said("seek", "N", "to step N of the branch"),
    said("last", "", "to the end of the branch"),
    said("event", "next|before", "to a subtask, failure, instruction or fork"),
    said("subtask", "N", "to the step that completed subtask N"),
    said("branch", "NAME|N", "to another branch"),
    said("branches", "", "list the branches"),
    said("name", "TEXT", "name the branch"),
    said("diverge", "NAME|N", "this branch and another, side by side"),
    said(
        "break",
        "[CONDITION]",
        "stop runs at: subtask, failed, drop X, gap X, entropy X, sees OBJECT, step N; without any, nowhere",
    ),
    said("until", "CONDITION", "run until that holds"),
    said("policy", "NAME", "who acts: agent, expert, random"),
    said("checkpoint", "NAME|N", "another checkpoint becomes the agent"),
    said("sample", "SEED", "draw the policy's actions by chance with this seed"),
    said("greedy", "", "the likeliest actions again"),
    said("compare", "TEXT", "this instruction and another in the same state"),
    said("swap", "", "adopt the other instruction of the comparison"),
    said("chain", "A; B; ...", "follow a chain of instructions, link by link and as one"),
    said("against", "NAME|N", "the same chain by another checkpoint, the expert or random, side by side"),
    said("links", "[N]", "which link breaks: N draws of each (8), from both entries"),
    said("link", "N [TIMES]", "the same for one link: from its recorded entry and the expert's"),
    said("values", "", "paint the value of every cell on the map; or end that"),
    said("heading", "best|north|...", "the heading whose values are painted"),
    said("stop", "", "stop work in the background"),
    said("save", "[DIR]", "write every branch as a run folder"),
    said("task", "FILE", "add this state and instruction as a task to a task file"),
    said("export", "FILE", "the branch as .gif, .png (this frame), .strip.png, .txt, or .html"),
    said("reset", "", "back to the start, with the present instruction"),
    said("next", "", "the next house or task"),
    said("seed", "N", "the house of another seed, or task N"),
    said("look", "", "what the agent sees"),
    said("candidates", "", "the interactions that are possible now"),
    said("think", "", "what the policy would do next"),
    said("bandwidth", "KB", "the most that a picture may cost on the wire; 0 for no limit"),
    said("frame", "", "one frame at full quality"),
    said("mouse", "", "clicks select, the wheel goes in time; or no longer"),
    said("faster", "", "a faster pace"),
    said("slower", "", "a slower pace"),
    said("manual", "", "take over, or give back"),
    said("page", "panels|mind|...", "panels, branches, mind, world, compare, or chain"),
    said("graphics", "", "show pictures another way"),
    said("overlay", "", "colours, depth, things, the five frames it sees"),
    said("numbers", "", "numbers in the picture, on or off"),
    said("sort", "", "sort the table of choices another way"),
    said("copy", "", "the instruction and the step to the clipboard"),
    said("help", "", "these verbs"),
    said("quit", "", "end"),
];

/// The typed verbs that fit what was typed so far, the best first: its letters in order, early and together.
pub fn matching(typed: &str) -> Vec<&'static Said> {
    let word = typed.split_whitespace().next().unwrap_or("").to_lowercase();
    let mut found: Vec<(usize, &Said)> = SAID
        .iter()
        .filter_map(|said| {
            let by_name = closeness(&word, said.name);
            let by_doc = closeness(&word, said.doc).filter(|_| word.len() > 2).map(|cost| cost + 100);
            by_name.or(by_doc).map(|cost| (cost, said))
        })
        .collect();
    found.sort_by_key(|&(cost, _)| cost);
    found.into_iter().map(|(_, said)| said).collect()
}

/// How far apart the letters of `word` lie in `text`; `None` where they are not all there in order.
fn closeness(word: &str, text: &str) -> Option<usize> {
    let text = text.to_lowercase();
    let mut cost = 0;
    let mut rest = text.as_str();
    for letter in word.chars() {
        let at = rest.find(letter)?;
        cost += at;
        rest = &rest[at + letter.len_utf8()..];
    }
    Some(cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_finds_verbs_by_their_letters() {
        assert_eq!(matching("exp")[0].name, "export");
        assert_eq!(matching("brk")[0].name, "break");
        assert_eq!(matching("seek 12")[0].name, "seek");
        assert_eq!(matching("clipboard")[0].name, "copy", "by what it does");
        assert_eq!(matching("").len(), SAID.len());
        assert!(matching("qqq").is_empty());
    }
}
