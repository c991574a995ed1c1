#!/usr/bin/env python3
"""Makes processes die, or never end, by what they do themselves: their next instruction is replaced (ptrace).

  hurt.py      reads lines "PID WAY" and answers each with a line: 0 done, 1 the process has ended meanwhile

  segv   it reads from address 0
  bus    it reads across a word while alignment is checked
  loop   it runs one instruction for ever
  exit   it ends with status 3
  oom    it fills its stack in a control group that has no memory for that, so the kernel kills it

Needs root, Linux on x86-64 and, for oom, the memory controller of cgroup v1. One hurt.py serves many lines, since
the process of a small job is gone before Python starts.
"""
import ctypes
import os
import sys
import time

libc = ctypes.CDLL(None, use_errno=True)
libc.ptrace.restype = ctypes.c_long
libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
POKETEXT, CONT, GETREGS, SETREGS, SEIZE, DETACH, INTERRUPT = 4, 7, 12, 13, 0x4206, 17, 0x4207
NAMES = ("r15 r14 r13 r12 rbp rbx r11 r10 r9 r8 rax rcx rdx rsi rdi orig_rax rip cs eflags rsp ss fs_base gs_base ds es "
         "fs gs").split()


class Registers(ctypes.Structure):
    _fields_ = [(name, ctypes.c_ulonglong) for name in NAMES]


def ptrace(what, pid, address=0, data=0):
    if libc.ptrace(what, pid, address, data) == -1:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


# The code that the process runs next, and the registers that it needs.
WAYS = {
    "segv": ("488b00", {"rax": 0}),  # mov rax, [rax]
    "bus": ("488b442401", {"eflags": 0x40000}),  # AC; mov rax, [rsp + 1]
    "loop": ("ebfe", {}),  # jmp to itself
    "exit": ("0f05", {"rax": 231, "rdi": 3}),  # exit_group(3)
    "oom": ("50ebfd", {}),  # push rax; jmp to that
}


def poison(pid, way):
    """Of a process that is stopped."""
    code, registers = WAYS[way]
    now = Registers()
    ptrace(GETREGS, pid, 0, ctypes.addressof(now))
    for name, value in registers.items():
        setattr(now, name, value | (now.eflags if name == "eflags" else 0))
    now.orig_rax = 2**64 - 1  # an interrupted system call is not restarted
    ptrace(SETREGS, pid, 0, ctypes.addressof(now))
    ptrace(POKETEXT, pid, now.rip, int.from_bytes(bytes.fromhex(code).ljust(8, b"\x90"), "little"))


def group_of(pid):
    """A control group with hardly any memory, which the process joins."""
    here = next(line.split(":")[2].strip() for line in open("/proc/self/cgroup") if ":memory:" in line)
    group = f"/sys/fs/cgroup/memory{here}/orbmorph-starve-{pid}"
    os.mkdir(group)
    for name, value in (("memory.limit_in_bytes", "65536"), ("cgroup.procs", str(pid))):
        with open(f"{group}/{name}", "w") as file:
            file.write(value)
    return group


def leave(group):
    """Once the process has ended."""
    for _ in range(500):
        try:
            os.rmdir(group)
            return
        except OSError:
            time.sleep(0.01)


def hurt(pid, way):
    group = None
    try:
        ptrace(SEIZE, pid)
        ptrace(INTERRUPT, pid)
        os.waitpid(pid, 0x40000000)  # __WALL
        if way == "oom":
            group = group_of(pid)
        poison(pid, way)
        ptrace(DETACH, pid)
        return True
    except (OSError, ChildProcessError) as error:
        print(f"{way} of {pid}: {error}", file=sys.stderr)
        return False
    finally:
        if group:
            leave(group)


for line in sys.stdin:
    number, name = line.split()
    print(0 if hurt(int(number), name) else 1, flush=True)
