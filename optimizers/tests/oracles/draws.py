"""The stream of random numbers of arm/src/rng.rs, written again: ChaCha with 8 rounds, keyed by PCG32.

With it the programs of this folder see the very numbers that the Rust code sees, without any hook in it.
"""
from math import cos, log, pi, sqrt

M32, M64 = 0xFFFFFFFF, 0xFFFFFFFFFFFFFFFF


def key(seed):
    """Eight words from one number, as rand_core's seed_from_u64 makes them."""
    words = []
    for _ in range(8):
        seed = (seed * 6364136223846793005 + 11634580027462260723) & M64
        mixed = (((seed >> 18) ^ seed) >> 27) & M32
        turn = seed >> 59
        words.append(((mixed >> turn) | (mixed << ((32 - turn) & 31))) & M32)
    return words


def rotate(x, by):
    return ((x << by) | (x >> (32 - by))) & M32


def quarter(s, a, b, c, d):
    for x, y, z, by in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
        s[x] = (s[x] + s[y]) & M32
        s[z] = rotate(s[z] ^ s[x], by)


class Draw:
    def __init__(self, seed, stream=0):
        self.key, self.stream, self.block, self.words = key(seed), stream, 0, []

    def word(self):
        if not self.words:
            start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574] + self.key
            start += [self.block & M32, self.block >> 32, self.stream & M32, self.stream >> 32]
            s = list(start)
            for _ in range(4):
                for column in range(4):
                    quarter(s, column, 4 + column, 8 + column, 12 + column)
                for i in range(4):
                    quarter(s, i, 4 + (i + 1) % 4, 8 + (i + 2) % 4, 12 + (i + 3) % 4)
            self.words = [(x + y) & M32 for x, y in zip(s, start)]
            self.block += 1
        return self.words.pop(0)

    def long(self):
        low = self.word()
        return low | (self.word() << 32)

    def unit(self):
        return (self.long() >> 11) / 2.0**53

    def within(self, low, high):
        return low + (high - low) * self.unit()

    def index(self, count):
        return self.long() % count

    def other(self, count, taken):
        """One of 0..count that is not taken."""
        free = [i for i in range(count) if i not in taken]
        return free[self.index(len(free))]

    def normal(self):
        u = 1.0 - self.unit()
        return sqrt(-2.0 * log(u)) * cos(2.0 * pi * self.unit())
