"""Pre-norm transformer blocks and the Token Pyramid Aggregation (paper, §3.2 TPA, Fig. 2)."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import relu

from etnet.nets.attention import MultiHeadAttention, Observer


class FeedForward(nn.Module):
    """Two linear layers with a ReLU between them."""

    def __init__(self, dim: int, hidden: int) -> None:
        super().__init__()
        self.expand = nn.Linear(dim, hidden)
        self.contract = nn.Linear(hidden, dim)

    def forward(self, tokens: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
        return self.contract(relu(self.expand(tokens)))


class EncoderLayer(nn.Module):
    """Self-attention, then feed-forward, each behind a norm and beside a residual."""

    def __init__(self, dim: int, heads: int, feed_forward: int, dropout: float, site: str, scaled: bool) -> None:
        super().__init__()
        self.attention_norm = nn.LayerNorm(dim)
        self.attention = MultiHeadAttention(dim, heads, f"{site}.self", scaled)
        self.feed_forward_norm = nn.LayerNorm(dim)
        self.feed_forward = FeedForward(dim, feed_forward)
        self.dropout = nn.Dropout(dropout)

    def forward(self, tokens: Float[Tensor, "b n c"], observer: Observer) -> Float[Tensor, "b n c"]:
        tokens = _attend(tokens, self.attention_norm(tokens), None, self.attention, self.dropout, observer)
        return tokens + self.dropout(self.feed_forward(self.feed_forward_norm(tokens)))


class DecoderLayer(nn.Module):
    """Self-attention, cross-attention to the coarser scale's tokens, feed-forward; norms on query and memory."""

    def __init__(self, dim: int, heads: int, feed_forward: int, dropout: float, site: str, scaled: bool) -> None:
        super().__init__()
        self.self_norm = nn.LayerNorm(dim)
        self.self_attention = MultiHeadAttention(dim, heads, f"{site}.self", scaled)
        self.query_norm = nn.LayerNorm(dim)
        self.memory_norm = nn.LayerNorm(dim)
        self.cross_attention = MultiHeadAttention(dim, heads, f"{site}.cross", scaled)
        self.feed_forward_norm = nn.LayerNorm(dim)
        self.feed_forward = FeedForward(dim, feed_forward)
        self.dropout = nn.Dropout(dropout)

    def forward(
        self, tokens: Float[Tensor, "b n c"], memory: Float[Tensor, "b m c"], observer: Observer
    ) -> Float[Tensor, "b n c"]:
        tokens = _attend(tokens, self.self_norm(tokens), None, self.self_attention, self.dropout, observer)
        query, keys = self.query_norm(tokens), self.memory_norm(memory)
        tokens = _attend(tokens, query, keys, self.cross_attention, self.dropout, observer)
        return tokens + self.dropout(self.feed_forward(self.feed_forward_norm(tokens)))


def _attend(
    tokens: Tensor,
    query: Tensor,
    memory: Tensor | None,
    attention: MultiHeadAttention,
    dropout: nn.Dropout,
    observer: Observer,
) -> Tensor:
    """Residual + attention, unless an intervention took the site out."""
    if attention.site in observer.intervention.removed_sites:
        return tokens
    return tokens + dropout(attention(query, query if memory is None else memory, observer))
