//! Weights files: `.safetensors` read strictly into named tensors, and written atomically.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use safetensors::{Dtype, SafeTensors};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tch::{Kind, Tensor, nn};

use crate::data::{atomic_file, plain_file};

use super::weights_error::Misshapen;
pub use super::weights_error::{Differences, TensorSpec, WeightsError};

/// Tensors by name.
pub type Tensors = BTreeMap<String, Tensor>;

/// Reads all tensors of a file, on the CPU.
///
/// # Errors
/// [`WeightsError::Unreadable`], [`WeightsError::Malformed`] or [`WeightsError::NotFinite`].
pub fn read(path: &Path) -> Result<Tensors, WeightsError> {
    Ok(read_with_metadata(path)?.0)
}

/// Reads all tensors of a file, on the CPU, and its `__metadata__`.
///
/// # Errors
/// [`WeightsError::Unreadable`], [`WeightsError::Malformed`] or [`WeightsError::NotFinite`].
pub fn read_with_metadata(path: &Path) -> Result<(Tensors, BTreeMap<String, String>), WeightsError> {
    let bytes = plain_file::read(path).map_err(|source| WeightsError::Unreadable { path: path.into(), source })?;
    let read = parse(&bytes).map_err(|reason| WeightsError::Malformed { path: path.into(), reason })?;
    check_finite(path, &read.0)?;
    Ok(read)
}

/// Checks that weights can be computed with: one number that is none makes every result none, or a plausible wrong one.
///
/// # Errors
/// [`WeightsError::NotFinite`], which names the file and the tensor.
pub(crate) fn check_finite(path: &Path, tensors: &Tensors) -> Result<(), WeightsError> {
    let mut found = tensors.iter().filter_map(|(name, tensor)| Some((name, not_a_weight(name, tensor)?)));
    let Some((name, what)) = found.next() else { return Ok(()) };
    Err(WeightsError::NotFinite { path: path.into(), name: name.clone(), what, others: found.count() })
}

/// What a tensor holds that no weight is.
fn not_a_weight(name: &str, tensor: &Tensor) -> Option<&'static str> {
    if !tensor.is_floating_point() || tensor.numel() == 0 {
        return None;
    }
    let any = |which: Tensor| which.any().int64_value(&[]) != 0;
    if any(tensor.isfinite().logical_not()) {
        return Some(if any(tensor.isnan()) { "NaN (not a number)" } else { "an infinite number" });
    }
    // Whoever normalises takes the root of it.
    (name.ends_with("running_var") && any(tensor.lt(0.0))).then_some("a variance below zero")
}

/// Reads tensors from a file's bytes; the error says what is wrong with them.
pub(super) fn parse(bytes: &[u8]) -> Result<(Tensors, BTreeMap<String, String>), String> {
    let file = SafeTensors::deserialize(bytes).map_err(|error| error.to_string())?;
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| error.to_string())?;
    let metadata = header.metadata().clone().unwrap_or_default().into_iter().collect();
    let mut tensors = Tensors::new();
    for (name, view) in file.iter() {
        let kind = kind(view.dtype()).ok_or_else(|| format!("{name} has type {:?}", view.dtype()))?;
        let shape: Result<Vec<i64>, _> = view.shape().iter().map(|&length| i64::try_from(length)).collect();
        let shape = shape.map_err(|_| format!("{name} has shape {:?}", view.shape()))?;
        let tensor = Tensor::f_from_data_size(view.data(), &shape, kind)
            .map_err(|error| format!("{name} cannot become a tensor: {error}"))?;
        tensors.insert(name.into(), tensor);
    }
    Ok((tensors, metadata))
}

/// Identifies weights: the first 16 digits of a sha256 over names and numbers, by name.
///
/// # Errors
/// When a tensor cannot be read as 32-bit floats.
pub(crate) fn digest(tensors: impl IntoIterator<Item = (String, Tensor)>) -> anyhow::Result<String> {
    let tensors: BTreeMap<String, Tensor> = tensors.into_iter().collect();
    let mut hash = Sha256::new();
    for (name, tensor) in tensors {
        hash.update(name.as_bytes());
        let numbers: Vec<f32> = tensor.detach().to_device(tch::Device::Cpu).flatten(0, -1).try_into()?;
        numbers.iter().for_each(|number| hash.update(number.to_le_bytes()));
    }
    Ok(format!("{:x}", hash.finalize())[..16].to_string())
}

/// Compares a file's tensors with what a model expects, both ways.
///
/// # Errors
/// [`WeightsError::Unfit`], which names every missing, extra and misshapen tensor and the file.
pub(crate) fn check(
    path: &Path,
    tensors: &Tensors,
    expected: &BTreeMap<String, TensorSpec>,
) -> Result<(), WeightsError> {
    let mut differences = Differences::default();
    for (name, expected) in expected {
        match tensors.get(name).map(TensorSpec::of) {
            None => differences.missing.push(name.clone()),
            Some(found) if found != *expected => {
                differences.misshapen.push(Misshapen { name: name.clone(), found, expected: expected.clone() });
            }
            Some(_) => {}
        }
    }
    differences.extra = tensors.keys().filter(|name| !expected.contains_key(*name)).cloned().collect();
    if differences == Differences::default() {
        return Ok(());
    }
    Err(WeightsError::Unfit { path: path.into(), differences })
}

/// Reads a file into a model's variables, all or none; returns its `__metadata__`.
///
/// # Errors
/// When the file cannot be read, is damaged, or differs from the variables in any name, shape or type.
#[cfg(test)]
pub(crate) fn load(path: &Path, variables: &mut nn::VarStore) -> Result<BTreeMap<String, String>, WeightsError> {
    let (tensors, metadata) = read_with_metadata(path)?;
    let mut targets: Tensors = variables.variables().into_iter().collect();
    let expected = targets.iter().map(|(name, tensor)| (name.clone(), TensorSpec::of(tensor))).collect();
    check(path, &tensors, &expected)?;
    tch::no_grad(|| {
        for (name, target) in &mut targets {
            target
                .f_copy_(&tensors[name])
                .map_err(|error| WeightsError::Malformed { path: path.into(), reason: format!("{name}: {error}") })?;
        }
        Ok(metadata)
    })
}

/// Copies tensors, those under `prefix`, over all of a store's variables of the same names.
///
/// # Errors
/// When one is missing or of another shape.
pub(crate) fn copy(from: &Tensors, prefix: &str, to: &nn::VarStore) -> anyhow::Result<()> {
    tch::no_grad(|| {
        for (name, mut variable) in to.variables() {
            let name = format!("{prefix}{name}");
            let tensor = from.get(&name).ok_or_else(|| anyhow::anyhow!("the tensor {name} is missing"))?;
            variable.f_copy_(tensor)?;
        }
        Ok(())
    })
}

/// The tensors with `prefix` before each name.
pub(crate) fn prefixed(prefix: &str, tensors: Tensors) -> Tensors {
    tensors.into_iter().map(|(name, tensor)| (format!("{prefix}{name}"), tensor)).collect()
}

/// The tensors under `prefix`, without it.
pub(crate) fn under(prefix: &str, tensors: &Tensors) -> Tensors {
    let stripped =
        |(name, tensor): (&String, &Tensor)| Some((name.strip_prefix(prefix)?.to_string(), tensor.shallow_clone()));
    tensors.iter().filter_map(stripped).collect()
}

/// Writes tensors and metadata to a file, atomically: a reader sees the old file or the whole new one.
///
/// The same tensors and metadata give the same bytes, so that a file's hash identifies its weights.
///
/// # Errors
/// [`WeightsError::Unwritable`].
pub fn write(path: &Path, tensors: &Tensors, metadata: &BTreeMap<String, String>) -> Result<(), WeightsError> {
    let bytes = encode(tensors, metadata);
    let written = bytes.and_then(|bytes| {
        let mut file = atomic_file::begin(path)?;
        file.write_all(&bytes)?;
        atomic_file::keep(file, path)
    });
    written.map_err(|source| WeightsError::Unwritable { path: path.into(), source })
}

/// The bytes of a safetensors file. Written here because the crate's own writer orders metadata by chance.
fn encode(tensors: &Tensors, metadata: &BTreeMap<String, String>) -> std::io::Result<Vec<u8>> {
    let mut header = serde_json::Map::new();
    if !metadata.is_empty() {
        header.insert("__metadata__".into(), json!(metadata));
    }
    let mut data = Vec::new();
    for (name, tensor) in tensors {
        let kind = tensor.kind();
        let dtype = dtype(kind).ok_or_else(|| std::io::Error::other(format!("{name} has type {kind:?}")))?;
        let plain = tensor.detach().to_device(tch::Device::Cpu).contiguous();
        let start = data.len();
        data.resize(start + plain.numel() * kind.elt_size_in_bytes(), 0);
        plain.f_copy_data_u8(&mut data[start..], plain.numel()).map_err(std::io::Error::other)?;
        let entry = json!({"dtype": dtype.to_string(), "shape": tensor.size(), "data_offsets": [start, data.len()]});
        header.insert(name.clone(), entry);
    }
    let mut header = Value::Object(header).to_string().into_bytes();
    header.resize(header.len().next_multiple_of(8), b' ');
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.append(&mut header);
    bytes.append(&mut data);
    Ok(bytes)
}

/// The element types that both sides know.
const KINDS: [(Dtype, Kind); 10] = [
    (Dtype::BOOL, Kind::Bool),
    (Dtype::U8, Kind::Uint8),
    (Dtype::I8, Kind::Int8),
    (Dtype::I16, Kind::Int16),
    (Dtype::I32, Kind::Int),
    (Dtype::I64, Kind::Int64),
    (Dtype::F16, Kind::Half),
    (Dtype::BF16, Kind::BFloat16),
    (Dtype::F32, Kind::Float),
    (Dtype::F64, Kind::Double),
];

fn kind(dtype: Dtype) -> Option<Kind> {
    KINDS.iter().find(|(known, _)| *known == dtype).map(|(_, kind)| *kind)
}

fn dtype(kind: Kind) -> Option<Dtype> {
    KINDS.iter().find(|(_, known)| *known == kind).map(|(dtype, _)| *dtype)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tch::Device;

    fn sample() -> Tensors {
        [
            ("conv.weight".to_string(), Tensor::from_slice(&[1.5f32, -2.0, 0.25, 8.0, 0.0, 3.0]).reshape([2, 3])),
            ("conv.bias".to_string(), Tensor::from_slice(&[0.5f32, 1.0])),
            ("steps".to_string(), Tensor::from(7i64)),
        ]
        .into()
    }

    fn forms(tensors: &Tensors) -> BTreeMap<String, TensorSpec> {
        tensors.iter().map(|(name, tensor)| (name.clone(), TensorSpec::of(tensor))).collect()
    }

    #[test]
    fn what_is_written_is_read_back_with_its_metadata() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.safetensors");
        let metadata: BTreeMap<String, String> = [("format_version", "1"), ("preset", "l-bc"), ("a", "ü\"\n")]
            .map(|(key, value)| (key.to_string(), value.to_string()))
            .into();
        write(&path, &sample(), &metadata).unwrap();
        let (tensors, found) = read_with_metadata(&path).unwrap();
        assert_eq!(found, metadata);
        assert_eq!(forms(&tensors), forms(&sample()));
        assert!(tensors.iter().all(|(name, tensor)| *tensor == sample()[name]));
        let bytes = std::fs::read(&path).unwrap();
        write(&path, &tensors, &metadata).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), bytes, "the same weights give the same bytes");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left behind");
    }

    #[test]
    fn a_view_that_is_not_contiguous_is_written_as_it_looks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let turned = sample()["conv.weight"].tr();
        write(&path, &[("w".to_string(), turned.shallow_clone())].into(), &BTreeMap::new()).unwrap();
        assert_eq!(read(&path).unwrap()["w"], turned);
    }

    #[test]
    fn every_difference_is_named_at_once() {
        let mut expected = forms(&sample());
        expected.insert("head.weight".into(), TensorSpec::float(&[12, 4]));
        expected.insert("conv.bias".into(), TensorSpec::float(&[3]));
        expected.remove("steps");
        let error = check(Path::new("shop/model.safetensors"), &sample(), &expected).unwrap_err().to_string();
        assert_eq!(
            error,
            "shop/model.safetensors: does not fit the model: missing head.weight; unknown steps; \
             conv.bias is Float[2] where Float[3] is expected"
        );
    }

    #[test]
    fn weights_that_are_no_numbers_are_refused_by_the_tensors_and_the_files_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let complaint = |name: &str, values: &[f32], kind: Kind| {
            let mut tensors = sample();
            tensors.insert(name.into(), Tensor::from_slice(values).to_kind(kind));
            write(&path, &tensors, &BTreeMap::new()).unwrap();
            read(&path).err().map(|error| error.to_string()).unwrap_or_default()
        };
        for kind in [Kind::Half, Kind::BFloat16, Kind::Float, Kind::Double] {
            for (number, what) in [(f32::NAN, "NaN"), (f32::INFINITY, "infinite"), (-f32::INFINITY, "infinite")] {
                let error = complaint("policy.out.weight", &[0.0, 1.0, number], kind);
                let parts = ["w.safetensors", "policy.out.weight", what, "train or fetch this one anew"];
                assert!(parts.iter().all(|part| error.contains(part)), "{error}");
            }
        }
        assert_eq!(complaint("policy.out.weight", &[0.0, -1.0, f32::MAX], Kind::Float), "");
        assert!(complaint("norm.running_var", &[1.0, -1.0], Kind::Float).contains("a variance below zero"));
    }

    #[test]
    fn another_element_type_is_a_difference() {
        let expected = [("steps".to_string(), TensorSpec::float(&[]))].into();
        let tensors = [("steps".to_string(), Tensor::from(7i64))].into();
        let error = check(Path::new("m"), &tensors, &expected).unwrap_err().to_string();
        assert!(error.contains("steps is Int64[] where Float[] is expected"), "{error}");
    }

    #[test]
    fn a_file_that_does_not_fit_leaves_the_model_as_it_was() {
        let _chance = crate::nets::testing::chance();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let mut model = nn::VarStore::new(Device::Cpu);
        let weight = model.root().var("weight", &[2, 2], nn::Init::Const(1.0));
        let _bias = model.root().var("bias", &[2], nn::Init::Const(1.0));
        let ones: Tensors = [("weight".to_string(), Tensor::zeros([2, 2], (Kind::Float, Device::Cpu)))].into();
        write(&path, &ones, &BTreeMap::new()).unwrap();
        assert!(matches!(load(&path, &mut model), Err(WeightsError::Unfit { .. })));
        assert_eq!(weight.sum(Kind::Float).double_value(&[]), 4.0);
    }

    #[test]
    fn damaged_files_are_errors_that_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        assert!(matches!(read(&path), Err(WeightsError::Unreadable { .. })));
        write(&path, &sample(), &BTreeMap::new()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let huge_header = [&u64::MAX.to_le_bytes()[..], &whole[8..]].concat();
        let huge_shape = {
            let header = br#"{"w":{"dtype":"F32","shape":[0,18446744073709551615],"data_offsets":[0,0]}}"#;
            [&(header.len() as u64).to_le_bytes()[..], header].concat()
        };
        for bytes in [&whole[..whole.len() - 1], &whole[..20], &whole[..0], &huge_header, &huge_shape, b"not weights"] {
            std::fs::write(&path, bytes).unwrap();
            let error = read(&path).unwrap_err();
            assert!(matches!(error, WeightsError::Malformed { .. }), "{error}");
            assert!(error.to_string().contains("w.safetensors"), "{error}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_damage_to_the_bytes_makes_the_reader_panic(at in 0usize..400, byte: u8, cut in 0usize..400) {
            let mut bytes = encode(&sample(), &BTreeMap::new()).unwrap();
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(cut.max(1));
            let _ = parse(&bytes);
        }
    }
}
