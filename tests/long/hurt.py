#!/usr/bin/env python3
"""Makes a process die, or never end, by what it does itself: its next instruction is replaced (ptrace).

  hurt.py PID WAY     WAY: segv   reads from address 0
                           bus    reads across a word while alignment is checked
                           loop   runs one instruction for ever
                           exit   ends with status 3
                           oom    needs memory that its control group does not have, so the kernel kills it

Needs root, Linux on x86-64 and, for oom, the memory controller of cgroup v1. Exit status 0: done; 1: the process has ended
meanwhile, or asked for no more memory; 2: this cannot be done here.
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


def code_of(way):
    """What the process runs next, and the registers that this needs."""
    if way == "segv":
        return bytes.fromhex("488b00"), {"rax": 0}  # mov rax, [rax]
    if way == "bus":
        return bytes.fromhex("488b442401"), {"eflags": 0x40000}  # AC; mov rax, [rsp + 1]
    if way == "loop":
        return bytes.fromhex("ebfe"), {}  # jmp to itself
    if way == "exit":
        return bytes.fromhex("0f05"), {"rax": 231, "rdi": 3}  # exit_group(3)
    print(__doc__, file=sys.stderr)
    sys.exit(2)


def poison(pid, way):
    code, registers = code_of(way)
    ptrace(SEIZE, pid)
    ptrace(INTERRUPT, pid)
    os.waitpid(pid, 0x40000000)  # __WALL
    now = Registers()
    ptrace(GETREGS, pid, 0, ctypes.addressof(now))
    for name, value in registers.items():
        setattr(now, name, value | (now.eflags if name == "eflags" else 0))
    now.orig_rax = 2**64 - 1  # a system call that was interrupted is not begun again
    ptrace(SETREGS, pid, 0, ctypes.addressof(now))
    ptrace(POKETEXT, pid, now.rip, int.from_bytes(code.ljust(8, b"\x90"), "little"))
    ptrace(DETACH, pid)


def starve(pid):
    """A control group with less memory than the process needs for its next pages."""
    groups = [line.split(":")[2].strip() for line in open("/proc/self/cgroup") if ":memory:" in line]
    if not groups:
        print("there is no memory controller of cgroup v1", file=sys.stderr)
        sys.exit(2)
    here = groups[0]
    group = f"/sys/fs/cgroup/memory{here}/orbmorph-starve-{pid}"
    os.mkdir(group)
    try:
        with open(f"{group}/memory.limit_in_bytes", "w") as limit:
            limit.write("65536")
        with open(f"{group}/cgroup.procs", "w") as processes:
            processes.write(str(pid))
        for _ in range(1000):
            if "oom_kill 1" in open(f"{group}/memory.oom_control").read():
                return True
            if not os.path.exists(f"/proc/{pid}"):
                return False
            time.sleep(0.005)
        with open(f"/sys/fs/cgroup/memory{here}/cgroup.procs", "w") as processes:
            processes.write(str(pid))
        return False
    finally:
        for _ in range(200):
            try:
                os.rmdir(group)
                break
            except OSError:
                time.sleep(0.01)


def main():
    pid, way = int(sys.argv[1]), sys.argv[2]
    try:
        if way == "oom":
            return 0 if starve(pid) else 1
        poison(pid, way)
        return 0
    except (OSError, ChildProcessError) as error:
        print(f"{way} of {pid}: {error}", file=sys.stderr)
        return 1


sys.exit(main())
