//! Small models, written as ONNX byte by byte.

/// A protobuf field of bytes.
fn bytes(field: u8, content: &[u8]) -> Vec<u8> {
    [&[field << 3 | 2][..], &varint(content.len() as u64), content].concat()
}

/// A protobuf field of a number.
fn number(field: u8, value: u64) -> Vec<u8> {
    [&[field << 3][..], &varint(value)].concat()
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut found = Vec::new();
    while value >= 128 {
        found.push(value as u8 | 128);
        value >>= 7;
    }
    found.push(value as u8);
    found
}

/// An input or output of float32 with this shape.
fn port(name: &str, shape: &[u64]) -> Vec<u8> {
    let dimensions: Vec<u8> = shape.iter().flat_map(|&size| bytes(1, &number(1, size))).collect();
    let tensor = [number(1, 1), bytes(2, &dimensions)].concat();
    [bytes(1, name.as_bytes()), bytes(2, &bytes(1, &tensor))].concat()
}

fn node(kind: &str, inputs: &[&str], output: &str) -> Vec<u8> {
    let inputs: Vec<u8> = inputs.iter().flat_map(|name| bytes(1, name.as_bytes())).collect();
    [inputs, bytes(2, output.as_bytes()), bytes(4, kind.as_bytes())].concat()
}

/// An ONNX file: frames of that shape times weights, a row a number, are the logits of actions.
pub(crate) fn onnx(weights: &[f32], input: &str, frames: &[u64]) -> Vec<u8> {
    let data: Vec<u8> = weights.iter().flat_map(|weight| weight.to_le_bytes()).collect();
    let rows: u64 = frames[1..].iter().product();
    let columns = weights.len() as u64 / rows;
    let tensor = [number(1, rows), number(1, columns), number(2, 1), bytes(8, b"weights"), bytes(9, &data)].concat();
    let graph = [
        bytes(1, &node("Flatten", &[input], "flat")),
        bytes(1, &node("MatMul", &["flat", "weights"], "actions")),
        bytes(2, b"policy"),
        bytes(5, &tensor),
        bytes(11, &port(input, frames)),
        bytes(12, &port("actions", &[1, columns])),
    ]
    .concat();
    [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat()
}

/// Weights by which the action of that place is chosen whatever is seen.
pub(crate) fn always(place: usize) -> Vec<f32> {
    (0..36).map(|at| if at % 3 == place { 1.0 } else { 0.0 }).collect()
}
