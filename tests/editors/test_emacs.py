"""Emacs with editors/emacs/plctool.el, in batch mode: mode, faces, formatting, errors of `compile`, and dap-mode."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from breakpoints import FILE, PROGRAM

ROOT = Path(__file__).resolve().parents[2]
EMACS = shutil.which("emacs")
ELPA = Path(os.environ.get("ELPA_TESTED", "/usr/share/emacs/site-lisp/elpa-src"))

pytestmark = pytest.mark.skipif(EMACS is None, reason="Emacs is not installed; make test-editors installs it")


def run(folder: Path, expression: str) -> str:
    """What Emacs prints for an expression, with main.st as its buffer."""
    paths = [str(Path(entry).resolve()) for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    command = folder / "plctool"
    command.write_text(
        f"#!/bin/sh\nPYTHONPATH={shlex.quote(os.pathsep.join(paths))} "
        f'exec {shlex.quote(sys.executable)} -m plctool "$@"\n'
    )
    command.chmod(0o755)
    assert EMACS is not None
    code = f'(with-current-buffer (find-file-noselect "main.st") (setq plctool-command "{command}") {expression})'
    options = ["--batch", "-Q", "-l", str(ROOT / "editors" / "emacs" / "plctool.el"), "--eval", code]
    ran = subprocess.run(
        [EMACS, *options], cwd=folder, env={**os.environ, "HOME": str(folder)}, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_a_source_has_its_mode_and_nested_comments(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("(* a (* b *) c *) PROGRAM Main // x\nx.end_if := 'it$'s' IF\n")
    faces = """
    (font-lock-ensure)
    (setq case-fold-search nil)
    (dolist (text '("a (" "c *" "PROGRAM" "x\n" "end_if" "s'" "IF"))
      (goto-char (point-min)) (search-forward text)
      (princ (format "%s " (get-text-property (match-beginning 0) 'face))))
    (princ major-mode)"""
    assert run(tmp_path, faces).split() == [
        "font-lock-comment-face",
        "font-lock-comment-face",
        "font-lock-keyword-face",
        "font-lock-comment-face",
        "font-lock-variable-name-face",
        "font-lock-string-face",
        "font-lock-keyword-face",
        "iecst-mode",
    ]


def test_the_buffer_is_formatted(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("program Main\nvar\nx:INT;\nend_var\nx:=1;\nend_program\n")
    formatted = run(tmp_path, "(plctool-format) (princ (buffer-string))")
    assert formatted == "PROGRAM Main\nVAR\n    x : INT;\nEND_VAR\nx := 1;\nEND_PROGRAM\n"


def test_a_source_with_an_error_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("PROGRAM Main x := ; END_PROGRAM\n")
    said = run(tmp_path, "(condition-case said (plctool-format) (error (princ said))) (princ (buffer-string))")
    assert "1:" in said
    assert said.endswith("PROGRAM Main x := ; END_PROGRAM\n")


def test_errors_of_check_are_found_in_their_lines(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("PROGRAM Main\nx := 1;\nEND_PROGRAM\n")
    found = """
    (require 'compile)
    (with-temp-buffer
      (insert "\n" (shell-command-to-string (concat plctool-command " check main.st 2>&1")))
      (compilation-mode) (compilation--ensure-parse (point-max))
      (goto-char (point-min)) (compilation-next-error 1 nil (point-min))
      (let ((location (compilation--message->loc (get-text-property (point) 'compilation-message))))
        (princ (list (compilation--loc->line location) (compilation--loc->col location)))))"""
    assert run(tmp_path, found).startswith("(2 ")


DEBUGGING = """
(dolist (folder (directory-files "ELPA" t "^[a-z]")) (add-to-list 'load-path folder))
(setq load-prefer-newer t dap-auto-configure-features nil dap-auto-show-output nil)
(require 'dap-mode)
(defun frames (session) (gethash 1 (dap--debug-session-thread-stack-frames session)))
(defun say (session)
  (while (not (frames session)) (accept-process-output nil 0.05))
  (seq-doseq (frame (frames session)) (princ (format "%s:%s " (gethash "name" frame) (gethash "line" frame))))
  (princ "\n"))
(find-file "FILE")
(goto-char (point-min)) (forward-line 14) (dap-breakpoint-add)
(dap-debug (list :type "plctool" :request "launch" :name "test" :program buffer-file-name))
(let ((session (dap--cur-session)))
  (say session)
  (let ((frame (gethash "id" (elt (frames session) 0))))
    (princ (format "%s\n" (gethash "result" (dap-request session "evaluate" :expression "step * 10" :frameId frame)))))
  (dap-step-in session) (say session)
  (dap-step-out session) (say session)
  (dap-disconnect session))
"""


@pytest.mark.skipif(
    not list(ELPA.glob("dap-mode-*")), reason="dap-mode is not installed; make test-editors installs it"
)
def test_dap_mode_debugs_a_program(tmp_path: Path) -> None:
    """A client of others: it halts at a breakpoint, shows the calls, evaluates, and steps into a function and out."""
    (tmp_path / FILE).write_text(PROGRAM)
    (tmp_path / "main.st").write_text("")
    said = run(tmp_path, DEBUGGING.replace("ELPA", str(ELPA)).replace("FILE", FILE))
    halted = "Counter:15 Main:25 "
    assert said.splitlines() == [halted, "10", f"Add:4 {halted}", halted]
