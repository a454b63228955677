//! What the terms on the explorer's screens mean.

/// Each term, and what it means.
pub(crate) const TERMS: &[(&str, &str)] = &[
    ("p", "how likely the policy takes this choice, 0 to 1"),
    ("entropy", "how undecided the policy is, in nats: 0 is certain, 1.4 about like a die of four sides"),
    (
        "V",
        "value of this state for the instruction: the success that is expected from here, 0 to 1, late success counting less",
    ),
    ("Q, min Q", "value of one choice in this state; the lower one of the critics' estimates"),
    ("advantage", "Q less V: above 0 the choice is better than what is expected here"),
    ("masked", "left out of the choices because it is impossible now; the reason stands beside it"),
    ("tried here", "masked: the agent did it already where it saw just the same; it may again once a thing was moved"),
    ("greedy", "the likeliest choice; `sample` draws by chance instead"),
    ("done .07", "how sure the agent is that the instruction is carried out"),
    ("expert", "a planner that knows the house and the subtasks; it does not read the instruction"),
    ("in reach", "close enough, in view and not shut in: what can be acted on now"),
    ("subtask", "one step of what is graded; it is ticked when the house shows it done"),
    ("link", "one instruction of a chain; by link: given one by one; as one: all links as one text"),
    ("link value", "V under each link's words at every step; without a critic the probability of what was done"),
    ("target", "what chaining learns where a link ends: V for the next link's instruction, within 0 to 1"),
    ("eq. 4", "min Q of a link's last action for the next link's words; chaining draws it to the target"),
    ("eq. 5", "the same for the words of both links joined"),
    ("expert's", "how often a link is done from the state in which the expert begins it"),
    ("own entry", "how often it is done from the state in which the agent itself begins it"),
    ("bits", "how far two instructions part the choices: 0 the same, 1 nothing in common (Jensen-Shannon)"),
    ("language", "the mean of that against eight fixed instructions: how much words matter in this state"),
    ("tokens", "the pieces in which the sentence encoder reads the instruction"),
    ("seed", "the number from which the house, or chance, is made: the same number, the same house"),
];
