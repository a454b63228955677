//! Arrays of numbers in messages: plain ones, and NumPy's as vla-eval and openpi pack them.

use rmpv::Value;

/// The field of a map, whose keys may be text or, as openpi packs some, bytes.
pub(super) fn field<'a>(map: &'a Value, name: &str) -> Option<&'a Value> {
    let is_named = |key: &Value| key.as_str() == Some(name) || key.as_slice() == Some(name.as_bytes());
    map.as_map()?.iter().find(|(key, _)| is_named(key)).map(|(_, value)| value).filter(|value| !value.is_nil())
}

/// An array of numbers with its shape; a number alone has none.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f64>,
}

impl Numbers {
    /// Reads a number, a list of numbers, a list of such lists, or one of NumPy's arrays.
    ///
    /// # Errors
    /// Says what is wrong with it.
    pub(super) fn read(value: &Value) -> Result<Numbers, String> {
        if let Some(number) = number(value) {
            return Ok(Numbers { shape: Vec::new(), values: vec![number] });
        }
        if let Some(data) = field(value, "data") {
            // A number of NumPy's own kind.
            if let Some(number) = number(data) {
                return Ok(Numbers { shape: Vec::new(), values: vec![number] });
            }
            return Numbers::unpack(value, data);
        }
        let items = value.as_array().ok_or("it is no array of numbers")?;
        let rows: Vec<Numbers> = items.iter().map(Numbers::read).collect::<Result<_, _>>()?;
        let inner = rows.first().map_or(Vec::new(), |row| row.shape.clone());
        if rows.iter().any(|row| row.shape != inner) {
            return Err("its rows differ in length".into());
        }
        let shape = std::iter::once(rows.len()).chain(inner).collect();
        Ok(Numbers { shape, values: rows.into_iter().flat_map(|row| row.values).collect() })
    }

    fn unpack(value: &Value, data: &Value) -> Result<Numbers, String> {
        let data = data.as_slice().ok_or("its data are no bytes")?;
        let dtype = field(value, "dtype").and_then(|dtype| dtype.as_str()).ok_or("it has no dtype")?;
        let shape = field(value, "shape").and_then(Value::as_array).ok_or("it has no shape")?;
        let shape: Vec<usize> = shape.iter().filter_map(|size| usize::try_from(size.as_u64()?).ok()).collect();
        let values: Vec<f64> = match dtype {
            "|b1" | "|u1" => data.iter().map(|&byte| f64::from(byte)).collect(),
            "|i1" => data.iter().map(|&byte| f64::from(byte as i8)).collect(),
            "<i2" => each(data, |bytes| f64::from(i16::from_le_bytes(bytes))),
            "<u2" => each(data, |bytes| f64::from(u16::from_le_bytes(bytes))),
            "<i4" => each(data, |bytes| f64::from(i32::from_le_bytes(bytes))),
            "<u4" => each(data, |bytes| f64::from(u32::from_le_bytes(bytes))),
            "<i8" => each(data, |bytes| i64::from_le_bytes(bytes) as f64),
            "<u8" => each(data, |bytes| u64::from_le_bytes(bytes) as f64),
            "<f4" => each(data, |bytes| f64::from(f32::from_le_bytes(bytes))),
            "<f8" => each(data, f64::from_le_bytes),
            other => return Err(format!("its dtype {other:?} is none of int, uint, float32, float64, bool")),
        };
        let size = shape.iter().try_fold(1_usize, |size, &side| size.checked_mul(side));
        if size != Some(values.len()) {
            return Err(format!("its shape {shape:?} does not fit its {} numbers", values.len()));
        }
        Ok(Numbers { shape, values })
    }
}

fn each<const N: usize>(data: &[u8], read: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    data.as_chunks::<N>().0.iter().map(|&bytes| read(bytes)).collect()
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value.as_bool().map(|is| f64::from(u8::from(is))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(dtype: &str, shape: &[u64], data: Vec<u8>) -> Value {
        let shape: Vec<Value> = shape.iter().map(|&size| size.into()).collect();
        Value::Map(vec![
            // As openpi packs it.
            (Value::Binary(b"__ndarray__".to_vec()), true.into()),
            (Value::Binary(b"data".to_vec()), Value::Binary(data)),
            (Value::Binary(b"dtype".to_vec()), dtype.into()),
            (Value::Binary(b"shape".to_vec()), Value::Array(shape)),
        ])
    }

    #[test]
    fn plain_numbers_lists_and_numpys_arrays_are_read() {
        let read = |value: &Value| Numbers::read(value).map(|numbers| (numbers.shape, numbers.values));
        assert_eq!(read(&3.into()), Ok((vec![], vec![3.0])));
        let row = |values: [f64; 2]| Value::Array(values.into_iter().map(Value::from).collect());
        assert_eq!(read(&Value::Array(vec![row([1.0, 2.0])])), Ok((vec![1, 2], vec![1.0, 2.0])));
        let floats: Vec<u8> = [0.5_f32, -1.0].iter().flat_map(|value| value.to_le_bytes()).collect();
        assert_eq!(read(&packed("<f4", &[2, 1], floats)), Ok((vec![2, 1], vec![0.5, -1.0])));
        assert_eq!(read(&packed("<i8", &[], 7_i64.to_le_bytes().to_vec())), Ok((vec![], vec![7.0])));
    }

    #[test]
    fn an_array_that_does_not_fit_its_shape_or_holds_objects_is_refused() {
        let refusal = |value: &Value| Numbers::read(value).unwrap_err();
        assert!(refusal(&packed("<f4", &[3], vec![0; 8])).contains("does not fit its 2 numbers"));
        assert!(refusal(&packed("|O", &[1], vec![0; 8])).contains("dtype"));
        assert!(refusal(&packed("<f4", &[u64::MAX, 2], vec![0; 8])).contains("does not fit"));
        let ragged = Value::Array(vec![Value::Array(vec![1.into()]), Value::Array(vec![])]);
        assert!(refusal(&ragged).contains("differ in length"));
    }
}
