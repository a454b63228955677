//! Fields of presets that were called otherwise in format 1.

/// The former names with today's, as paths of a preset.
const FORMER: [(&str, &str); 25] = [
    ("balance", "logit_adjustment"),
    ("past", "data.history_start"),
    ("named", "data.object_target (\"ahead\" is \"next\")"),
    ("eyes", "visual_backbone"),
    ("visual", "visual_encoder"),
    ("input", "visual_encoder.image_size"),
    ("visual_training", "visual_encoder_training"),
    ("batch", "batch_size"),
    ("final_share", "final_fraction"),
    ("halved", "downsample"),
    ("target_rate", "iql.target_update_rate"),
    ("warmup_share", "iql.cloning_fraction"),
    ("weighing", "iql.advantage_scale"),
    ("worth", "chaining.bootstrap"),
    ("extracted", "chaining.policy_extraction (\"joint\" is \"aggregate\")"),
    ("normalised", "chaining.batch_norm_statistics (\"by-demonstrations\" is \"demonstrations\")"),
    ("weight", "chaining.loss_weight"),
    ("chain", "chaining.chain_weight"),
    ("aggregate", "chaining.aggregate_weight"),
    ("cut", "nothing: it is always uniform"),
    ("clip", "nothing: rewards are always clipped"),
    ("appraisal", "validation"),
    ("words", "policy.attention.vocabulary_size"),
    ("inner", "policy.attention.feedforward"),
    ("goal", "policy.goal_channels"),
];

/// What an error of an unknown field adds, where that was the name of a field.
pub(super) fn hint(error: &str) -> String {
    let unknown =
        error.split_once("unknown field `").and_then(|(_, rest)| rest.split_once('`')).map(|(field, _)| field);
    let former = unknown.and_then(|field| FORMER.iter().find(|(former, _)| *former == field));
    former.map_or_else(String::new, |(former, today)| {
        format!(" ({former} is a name of format 1, for which there is now {today})")
    })
}

#[cfg(test)]
mod tests {
    use super::super::Preset;

    #[test]
    fn a_field_of_an_older_format_is_told_with_its_present_name() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |text: &str| {
            let file = folder.path().join("old.toml");
            std::fs::write(&file, text).unwrap();
            format!("{:#}", Preset::named(file.to_str().unwrap()).unwrap_err())
        };
        let told = refused("extends = \"sprint\"\nbalance = 0.3");
        assert!(told.contains("balance is a name of format 1, for which there is now logit_adjustment"), "{told}");
        let told = refused("extends = \"sprint\"\n[iql]\nwarmup_share = 0.3");
        assert!(told.contains("there is now iql.cloning_fraction"), "{told}");
        let told = refused("extends = \"sprint\"\ncolour = 1");
        assert!(told.contains("unknown field `colour`") && !told.contains("format 1"), "{told}");
    }
}
