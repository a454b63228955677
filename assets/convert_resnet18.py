"""Writes torchvision's ResNet-18 weights as safetensors: convert_resnet18.py resnet18-f37072fd.pth resnet18.safetensors

Needs torch and safetensors. Only the tensors are read (weights_only), no code is run."""

import sys

import torch
from safetensors.torch import save_file

source, target = sys.argv[1:]
state = torch.load(source, map_location="cpu", weights_only=True)
save_file({name: tensor.contiguous() for name, tensor in state.items()}, target)
print(f"{target}: {len(state)} tensors")
