"""The JAX program as pure functions: draws to the bit, under jit, vmap and scan, as Gymnasium's FuncEnv."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import taskspec
from tests.shared.sections import build_text

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402

from taskspec.envs.functional import TaskFuncEnv  # noqa: E402
from taskspec.language import draws  # noqa: E402
from taskspec.programs.jax import Functional, library  # noqa: E402
from taskspec.programs.jax.library import threefry  # noqa: E402
from tests.shared.sparse import sparse  # noqa: E402


def scalar_episode(name: str, seed: int, actions: Any) -> tuple[list[Any], list[float]]:
    env = taskspec.make(name)
    seen = [env.reset(seed=seed)[0]]
    rewards = []
    for action in actions:
        obs, reward, terminated, truncated, _ = env.step(action)
        rewards.append(reward)
        seen.append(env.reset()[0] if terminated or truncated else obs)
    return seen, rewards


def test_threefry_gives_the_published_answers() -> None:
    """Known answers of Random123 for threefry2x32, 20 rounds."""
    ones = jnp.uint32(0xFFFFFFFF)
    known = [
        ((0, 0, 0, 0), (0x6B200159, 0x99BA4EFE)),
        ((ones, ones, ones, ones), (0x1CB996FC, 0xBB002BE7)),
        ((0x13198A2E, 0x03707344, 0x243F6A88, 0x85A308D3), (0xC4923A9C, 0x483DF7A0)),
    ]
    for words, answer in known:
        assert tuple(int(x) for x in threefry(*(jnp.uint32(w) for w in words))) == answer


# -- draws, against those of `taskspec.language.draws` ---------------------------------------------------------------------

LANES = 2**13
STEPS = 16
SIZE = 8
"""A million words for each kind of draw."""
_RNG = np.random.default_rng(0)
CONCENTRATIONS = np.float32(10 ** _RNG.uniform(-5, 8, (SIZE, LANES)))
SHAPES = np.float32(10 ** _RNG.uniform(-1.5, 2, (SIZE, LANES)))
RATES = np.float32(_RNG.uniform(0, 150, (SIZE, LANES)))
COUNTS = _RNG.integers(1, 2**31, (SIZE, LANES), dtype=np.int32)
LIMITS = draws.reachable(draws.thresholds(_RNG.uniform(0, 1, 40).tolist()))


def apart(words: Any, each: int) -> Any:
    """Words of SIZE draws as (words a draw, SIZE, lanes)."""
    return words.reshape(SIZE, each, -1).swapaxes(0, 1)


DRAWN: dict[str, tuple[int, Callable[[Any, Any], Any]]] = {
    "uniform": (1, lambda x, words: x.uniforms(words)),
    "exponential": (1, lambda x, words: x.exponentials(words)),
    "normal": (1, lambda x, words: x.normals(words, SIZE)),
    "dirichlet": (draws.GAMMA_WORDS, lambda x, words: x.dirichlets(words, CONCENTRATIONS)),
    "poisson": (1, lambda x, words: x.poissons(words[None], RATES / 3, 50.0)),
    "poisson of several words": (3, lambda x, words: x.poissons(apart(words, 3), RATES, 150.0)),
    "bernoulli": (1, lambda x, words: x.bernoullis(words, RATES / 150)),
    "index": (1, lambda x, words: x.indices(words, COUNTS)),
    "categorical": (1, lambda x, words: x.categoricals(words, LIMITS)),
    "weighted": (1, lambda x, words: x.weighted_categoricals(words, SHAPES[:, None])),
    "permutation": (1, lambda x, words: x.permutations(words)),
}
"""How many words each of SIZE draws takes, and what is drawn, by a library."""


ONE_BY_ONE = ("uniform", "normal", "dirichlet", "permutation")
"""To be tried also as few draws are made: word by word."""


@pytest.mark.parametrize(
    ("base", "unrolled"), sparse([*((b, False) for b in DRAWN), *((b, True) for b in ONE_BY_ONE)], 4)
)
def test_draws_are_equal_to_the_bit_inside_scan(base: str, unrolled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """XLA fuses and reorders what it can, and still every draw is the one that NumPy gives."""
    each, drawn = DRAWN[base]
    monkeypatch.setattr(library, "UNROLLED", each * SIZE if unrolled else 0)
    keys = np.random.default_rng(list(DRAWN).index(base)).integers(0, 2**32, (2, LANES), dtype=np.uint32)

    def step(n: Any, _: Any) -> Any:
        words = library.RandomWords(keys[0], keys[1], n, draws.STEP, each * SIZE)
        rows = words.rows(0, each * SIZE)
        return n + 1, (drawn(library, rows), rows)

    start = jnp.zeros(LANES, jnp.uint32)
    found, words = jax.jit(lambda n: jax.lax.scan(step, n, None, max(2, STEPS // each))[1])(start)
    for one, of in zip(np.asarray(found), np.asarray(words), strict=True):
        np.testing.assert_array_equal(one, drawn(draws, of))


RAW = """
summary: Draws as they come, and sums of them.
state:
  u: {type: real}
  e: {type: real}
  n: {type: real, shape: [5]}
action:
  a: {type: int, low: 0, high: 1}
horizon: 9
initial: {u: "Uniform(0, 1)", e: Exponential(1), n: "Normal(0, 1, shape=5)"}
dynamics: {u': "Uniform(0, 1)", e': Exponential(1), n': "Normal(0, 1, shape=5)"}
reward: 0
"""


def test_draws_are_equal_to_the_bit_in_vmapped_programs() -> None:
    functional = Functional(build_text(RAW))
    env = taskspec.make(build_text(RAW))
    seeds = jnp.arange(64, dtype=jnp.uint32)

    @jax.jit
    def walk(seeds: Any) -> Any:
        def one(seed: Any) -> Any:
            first, state = functional.reset(jnp.stack([jnp.uint32(0), seed]))
            return first, jax.lax.scan(lambda s, _: functional.step(s, 0)[1::-1], state, None, 40)[1]

        return jax.vmap(one)(seeds)

    first, rest = walk(seeds)
    for seed in range(64):
        np.testing.assert_array_equal(first[seed], env.reset(seed=seed)[0])
        for seen in np.asarray(rest[seed]):
            expected, _, _, truncated, _ = env.step(0)
            np.testing.assert_array_equal(seen, env.reset()[0] if truncated else expected)


# -- pure functions -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["derail/RiskyPath-v0", "derail/Sort-v0", "derail/NoisyObs-v0"])
def test_the_key_is_the_seed(name: str) -> None:
    functional = Functional(taskspec.load(name))
    env = taskspec.make(name)
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(30)]
    expected, rewards = scalar_episode(name, 7, actions)
    seen, state = jax.jit(functional.reset)(jax.random.key(7))
    np.testing.assert_allclose(seen, expected[0], rtol=2e-6, atol=2e-6)
    step = jax.jit(functional.step)
    for action, following, reward in zip(actions, expected[1:], rewards, strict=True):
        seen, state, paid, _, _ = step(state, jnp.array(action))
        np.testing.assert_allclose(seen, following, rtol=2e-6, atol=2e-6)
        assert float(paid) == reward


def test_vmap_and_scan() -> None:
    """Environments in a batch over the first axis, all steps in one scan."""
    functional = Functional(taskspec.load("derail/RiskyPath-v0"))
    keys = jnp.stack([jax.random.key_data(jax.random.key(s)) for s in range(5)])
    actions = jnp.array(np.random.default_rng(0).integers(0, 2, (20, 5)))
    _, states = jax.vmap(functional.reset)(keys)

    def body(states: Any, action: Any) -> Any:
        seen, states, reward, done, _ = jax.vmap(functional.step)(states, action)
        return states, (seen, reward, done)

    _, (seen, rewards, _) = jax.jit(lambda s: jax.lax.scan(body, s, actions))(states)
    for lane in range(5):
        expected, paid = scalar_episode("derail/RiskyPath-v0", lane, [int(a) for a in actions[:, lane]])
        assert seen[:, lane].tolist() == expected[1:]
        assert rewards[:, lane].tolist() == paid


def test_func_env() -> None:
    task = taskspec.load("derail/EarlyTermPos-v0")
    env = TaskFuncEnv(task)
    scalar = taskspec.make(task)
    key = jax.random.key(0)
    state = env.initial(key)
    assert int(env.observation(state, key)) == scalar.reset(seed=0)[0]
    for action in (1, 1):
        following = env.transition(state, jnp.int32(action), key)
        seen, reward, terminated, _, _ = scalar.step(action)
        assert int(env.observation(following, key)) == seen
        assert float(env.reward(state, action, following, key)) == reward
        assert bool(env.terminal(following, key)) == terminated
        state = following


def test_gymnasium_steps_the_func_env() -> None:
    functional_env = pytest.importorskip("gymnasium.envs.functional_jax_env").FunctionalJaxEnv
    env = functional_env(TaskFuncEnv(taskspec.load("derail/RiskyPath-v0")))
    assert int(env.reset(seed=0)[0]) == 0
    seen, reward, *_ = zip(*(env.step(1) for _ in range(3)), strict=True)
    assert (int(seen[0]), reward[0]) in {(2, 1.0), (3, -100.0)}


def test_func_env_under_scan() -> None:
    env = TaskFuncEnv(taskspec.load("derail/RiskyPath-v0"))

    def step(state: Any, action: Any) -> Any:
        following = env.transition(state, action, None)
        return following, env.observation(following, None)

    _, seen = jax.jit(lambda s: jax.lax.scan(step, s, jnp.ones(4, jnp.int32)))(env.initial(jax.random.key(7)))
    scalar = taskspec.make("derail/RiskyPath-v0")
    scalar.reset(seed=7)
    assert seen.tolist() == [scalar.step(1)[0] for _ in range(4)]


def test_other_kinds_of_keys() -> None:
    """Keys of four words count by the first two, which for small seeds are those of Threefry's."""
    functional = Functional(taskspec.load("derail/Sort-v0"))
    expected = functional.reset(jax.random.PRNGKey(5))[0].tolist()
    assert functional.reset(jax.random.key(5))[0].tolist() == expected
    assert functional.reset(jax.random.key(5, impl="rbg"))[0].tolist() == expected


QUOTIENTS = """
parameters: {d: {type: int, default: 7, low: 1, high: 99}}
state: {x: {type: int, low: 0, high: 2000}, b: {type: int, low: 0, high: 2000}}
action: {a: {type: bool}}
horizon: 2000
initial: {x: 0, b: 0}
dynamics: {x': "min(x + 1, 2000)", b': ceil(x / d)}
reward: x / 7 == x // 7
"""


@pytest.mark.parametrize("varying", [[], ["d"]], ids=["a constant", "an argument"])
def test_quotients_of_ints_are_exact_in_scan_and_vmap(varying: list[str]) -> None:
    task = Functional(build_text(QUOTIENTS), varying)

    def episode(key: Any) -> Any:
        def step(state: Any, _: Any) -> Any:
            seen, following, reward, _, _ = task.step(state, 1)
            return following, (seen[1], reward)

        return jax.lax.scan(step, task.reset(key)[1], length=1000)[1]

    boxes = [-(-x // 7) for x in range(1000)]
    pays = [x % 7 == 0 for x in range(1000)]
    assert np.array_equal(jax.jit(episode)(jax.random.key(0)), [boxes, pays])
    assert np.array_equal(jax.vmap(episode)(jax.random.split(jax.random.key(0), 2)), [[boxes] * 2, [pays] * 2])
