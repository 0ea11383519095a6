from typing import Any

import jax

from taskspec.exact import score
from taskspec.programs.jax import Functional

env = Functional("RiskyPath").gymnax()


def loss(logits: jax.Array, key: jax.Array) -> Any:
    def act(carry: Any, key: jax.Array) -> Any:
        seen, state = carry
        action = jax.random.categorical(key, logits[seen])
        step = jax.vmap(env.step, in_axes=(None, 0, 0, None))
        following, state, reward, *_ = step(key, state, action, env.default_params)
        return (following, state), (jax.nn.log_softmax(logits)[seen, action], reward)

    start = jax.vmap(env.reset)(jax.random.split(key, 256))
    _, (log_probs, rewards) = jax.lax.scan(act, start, jax.random.split(key, 5))
    to_go = rewards[::-1].cumsum(axis=0)[::-1]
    return -(log_probs * (to_go - to_go.mean(axis=1, keepdims=True))).mean()


slope, logits = jax.jit(jax.grad(loss)), jax.numpy.zeros((4, env.num_actions))
for key in jax.random.split(jax.random.key(0), 300):
    logits -= 0.2 * slope(logits, key)
print("REINFORCE", score("RiskyPath", jax.nn.softmax(logits).T).normalised)
