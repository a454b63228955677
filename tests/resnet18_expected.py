"""The numbers that the test of src/nets/resnet18.rs expects: torchvision's ResNet-18 with weights by formula.

Needs torch 2.11, torchvision 0.26 and numpy; prints Rust."""

import numpy as np
import torch
import torchvision


def numbers(name, count):
    seed = 7
    for byte in name.encode():
        seed = (seed * 31 + byte) & 0xFFFFFFFF
    x = (np.arange(count, dtype=np.uint64) * 2654435761 + seed).astype(np.uint32)
    x = ((x ^ (x >> 15)).astype(np.uint64) * 0x2C1B3C6D).astype(np.uint32)
    x = ((x ^ (x >> 12)).astype(np.uint64) * 0x297A2D39).astype(np.uint32)
    x = x ^ (x >> 15)
    return (x >> 8).astype(np.float32) / np.float32(16777216.0) - np.float32(0.5)


def weights(name, shape):
    chance = numbers(name, int(np.prod(shape)))
    kind = name.rsplit(".", 1)[1]
    if kind == "running_var":
        values = 1 + chance
    elif kind == "weight" and len(shape) == 1:
        values = 1 + np.float32(0.4) * chance
    elif kind == "weight":
        values = chance * np.sqrt(np.float32(14.0) / np.float32(np.prod(shape[1:])))
    else:
        values = np.float32(0.4) * chance
    return torch.from_numpy(values.reshape(shape).astype(np.float32))


net = torchvision.models.resnet18(weights=None).eval()
state = net.state_dict()
for name, tensor in state.items():
    if not name.startswith("fc.") and not name.endswith("num_batches_tracked"):
        tensor.copy_(weights(name, tuple(tensor.shape)))
net.load_state_dict(state)
image = ((numbers("image", 3 * 224 * 224) + np.float32(0.5)) * 256).astype(np.uint8).reshape(1, 3, 224, 224)
x = torch.from_numpy(image).float() / 255
x = torchvision.transforms.Normalize((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))(x)
trunk = torch.nn.Sequential(*list(net.children())[:-2])
with torch.no_grad():
    maps = trunk(x).flatten()
print(", ".join(f"{value:.6f}" for value in maps[::392].tolist()))
