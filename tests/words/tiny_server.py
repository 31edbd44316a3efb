"""A real OpenAI-compatible server (llama.cpp's own) that serves a model made here: it says "cupboard:rotation" to everything.

The language model has one layer that does nothing: what comes next follows from the last token alone, and the last token of
every prompt leads to the answer. The vision encoder is random, but pictures are decoded, encoded and read like any others.
Prints the server's address and serves until its standard input is closed.

    python tiny_server.py FOLDER        # the two model files are written there
"""

import sys
from pathlib import Path

import gguf
import numpy as np
import xllamacpp

ANSWER = "cupboard:rotation"
WIDTH, FEED, HEADS, CONTEXT = 64, 128, 4, 4096
RANDOM = np.random.default_rng(7)


def small(*shape):
    return (0.02 * RANDOM.standard_normal(shape)).astype(np.float32)


def zeros(*shape):
    return np.zeros(shape, dtype=np.float32)


def ones(*shape):
    return np.ones(shape, dtype=np.float32)


def write(path, arch, fill):
    writer = gguf.GGUFWriter(str(path), arch)
    fill(writer)
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()


def language_model(writer):
    # Every byte is a token, so is a blank, and so is the whole answer.
    normal, unknown, control, byte = 1, 2, 3, 6
    tokens = [(b"<unk>", unknown), (b"<s>", control), (b"</s>", control)]
    tokens += [(f"<0x{b:02X}>".encode(), byte) for b in range(256)]
    tokens += [("\u2581".encode(), normal), (ANSWER.encode(), normal), (b">", normal)]
    end, answer, last = 2, len(tokens) - 2, len(tokens) - 1
    count = len(tokens)

    writer.add_name("tiny")
    writer.add_context_length(CONTEXT)
    writer.add_embedding_length(WIDTH)
    writer.add_block_count(1)
    writer.add_feed_forward_length(FEED)
    writer.add_head_count(HEADS)
    writer.add_head_count_kv(HEADS)
    writer.add_layer_norm_rms_eps(1e-5)
    writer.add_rope_dimension_count(WIDTH // HEADS)
    writer.add_vocab_size(count)
    writer.add_tokenizer_model("llama")
    writer.add_token_list([text for text, _ in tokens])
    writer.add_token_scores([0.0] * count)
    writer.add_token_types([kind for _, kind in tokens])
    writer.add_unk_token_id(0)
    writer.add_bos_token_id(1)
    writer.add_eos_token_id(end)
    writer.add_chat_template("{% for m in messages %}{{ m.content }}{% endfor %}>")

    embedding = RANDOM.standard_normal((count, WIDTH)).astype(np.float32)
    output = small(count, WIDTH)
    output[answer] = embedding[last]
    output[end] = embedding[answer]
    writer.add_tensor("token_embd.weight", embedding)
    writer.add_tensor("output.weight", output)
    writer.add_tensor("output_norm.weight", ones(WIDTH))
    writer.add_tensor("blk.0.attn_norm.weight", ones(WIDTH))
    writer.add_tensor("blk.0.ffn_norm.weight", ones(WIDTH))
    for name in ("attn_q", "attn_k", "attn_v"):
        writer.add_tensor(f"blk.0.{name}.weight", small(WIDTH, WIDTH))
    writer.add_tensor("blk.0.attn_output.weight", zeros(WIDTH, WIDTH))
    writer.add_tensor("blk.0.ffn_gate.weight", small(FEED, WIDTH))
    writer.add_tensor("blk.0.ffn_up.weight", small(FEED, WIDTH))
    writer.add_tensor("blk.0.ffn_down.weight", zeros(WIDTH, FEED))


def vision_encoder(writer):
    image, patch, width, feed = 56, 14, 32, 64
    writer.add_bool("clip.has_vision_encoder", True)
    writer.add_bool("clip.has_llava_projector", True)
    writer.add_string("clip.projector_type", "mlp")
    writer.add_bool("clip.use_gelu", True)
    writer.add_uint32("clip.vision.image_size", image)
    writer.add_uint32("clip.vision.patch_size", patch)
    writer.add_uint32("clip.vision.embedding_length", width)
    writer.add_uint32("clip.vision.feed_forward_length", feed)
    writer.add_uint32("clip.vision.projection_dim", WIDTH)
    writer.add_uint32("clip.vision.attention.head_count", 2)
    writer.add_float32("clip.vision.attention.layer_norm_epsilon", 1e-5)
    writer.add_uint32("clip.vision.block_count", 1)
    writer.add_array("clip.vision.image_mean", [0.5, 0.5, 0.5])
    writer.add_array("clip.vision.image_std", [0.5, 0.5, 0.5])

    places = (image // patch) ** 2 + 1
    writer.add_tensor("v.class_embd", small(width))
    writer.add_tensor("v.patch_embd.weight", small(width, 3, patch, patch))
    writer.add_tensor("v.position_embd.weight", small(places, width))
    for name in ("v.pre_ln", "v.blk.0.ln1", "v.blk.0.ln2"):
        writer.add_tensor(f"{name}.weight", ones(width))
        writer.add_tensor(f"{name}.bias", zeros(width))
    for name in ("attn_q", "attn_k", "attn_v", "attn_out"):
        writer.add_tensor(f"v.blk.0.{name}.weight", small(width, width))
        writer.add_tensor(f"v.blk.0.{name}.bias", zeros(width))
    writer.add_tensor("v.blk.0.ffn_up.weight", small(feed, width))
    writer.add_tensor("v.blk.0.ffn_up.bias", zeros(feed))
    writer.add_tensor("v.blk.0.ffn_down.weight", small(width, feed))
    writer.add_tensor("v.blk.0.ffn_down.bias", zeros(width))
    writer.add_tensor("mm.0.weight", small(WIDTH, width))
    writer.add_tensor("mm.0.bias", zeros(WIDTH))
    writer.add_tensor("mm.2.weight", small(WIDTH, WIDTH))
    writer.add_tensor("mm.2.bias", zeros(WIDTH))


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "tiny.gguf", "llama", language_model)
    write(folder / "tiny-mmproj.gguf", "clip", vision_encoder)
    params = xllamacpp.CommonParams()
    params.model.path = str(folder / "tiny.gguf")
    params.mmproj.path = str(folder / "tiny-mmproj.gguf")
    params.n_ctx = CONTEXT
    params.n_parallel = 1
    params.warmup = False
    server = xllamacpp.Server(params)
    print(server.listening_address, flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()
