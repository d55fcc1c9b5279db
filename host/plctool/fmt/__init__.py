"""The formatter of Structured Text (`plctool fmt`): moves white space, writes keywords in capitals, changes
nothing else.

scan.py reads tokens and what stands between them, lines.py splits them into lines, spacing.py and layout.py write a
line, formatter.py puts the lines together and checks that the program is the same.

SPDX-License-Identifier: Apache-2.0
"""
