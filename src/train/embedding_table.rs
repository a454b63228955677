//! Rows of numbers, such as embeddings, in memory and on the device that computes.

use tch::{Device, Kind, Tensor};

/// Rows of numbers, such as embeddings.
pub struct EmbeddingTable {
    numbers: Vec<f32>,
    width: usize,
    /// The same on the device, where that is not the CPU.
    on_device: Option<Tensor>,
}

impl EmbeddingTable {
    /// Of a tensor [rows, width], to be read on `device`.
    ///
    /// # Errors
    /// When the tensor is no matrix of numbers.
    pub fn new(tensor: &Tensor, device: Device) -> anyhow::Result<EmbeddingTable> {
        let (_, width) = tensor.size2()?;
        let numbers = Vec::<f32>::try_from(tensor.to_device(Device::Cpu).to_kind(Kind::Float).flatten(0, -1))?;
        let on_device = (device != Device::Cpu).then(|| tensor.to_device(device));
        Ok(EmbeddingTable { numbers, width: width as usize, on_device })
    }

    /// The embeddings of some rows, [n, width].
    ///
    /// # Errors
    /// When there is no such row.
    pub(crate) fn rows(&self, rows: impl Iterator<Item = usize>, device: Device) -> anyhow::Result<Tensor> {
        if let Some(on_device) = &self.on_device {
            let rows: Vec<i64> = rows.map(|row| row as i64).collect();
            return Ok(on_device.f_index_select(0, &Tensor::from_slice(&rows).to_device(on_device.device()))?);
        }
        let mut numbers: Vec<f32> = Vec::new();
        for row in rows {
            let numbers_of = self.numbers.get(row * self.width..(row + 1) * self.width);
            numbers.extend(numbers_of.ok_or_else(|| anyhow::anyhow!("there is no row {row}"))?);
        }
        let width = self.width as i64;
        Ok(Tensor::from_slice(&numbers).view([-1, width]).to_device(device))
    }
}
