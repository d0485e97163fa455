import subprocess
import sys

SHOW = """
import gc, weakref
from rolling_panda.runtime.garbage import keep_what_is_there

class Ring: pass

def ring():
    one = Ring()
    one.itself = one
    return weakref.ref(one)

before = ring()
keep_what_is_there()
after = ring()
gc.collect()
print(len(gc.get_objects()) < 1000, before() is None, after() is None)
"""


def test_what_is_there_is_left_alone_and_what_becomes_garbage_is_not() -> None:
    done = subprocess.run([sys.executable, "-c", SHOW], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True"] * 3
