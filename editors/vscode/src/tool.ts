// Finds plctool and runs it. Without VS Code, so that it is tested alone.

import { execFile } from 'node:child_process';
import { existsSync } from 'node:fs';
import * as path from 'node:path';

import { isObject, text, type Json, type JsonObject } from './json';

export interface Tool {
  readonly path: string;
  readonly environment: Readonly<Record<string, string>>;
}

/** Raised with the message of plctool, or one that says why it did not run. */
export class ToolError extends Error {}

/** The plctool to start: the configured one, that of the workspace's virtual environment, or the one on the PATH. */
export function findTool(configured: string, folders: readonly string[], exists = existsSync): string {
  if (configured !== '') return configured;
  const inside = process.platform === 'win32' ? ['Scripts', 'plctool.exe'] : ['bin', 'plctool'];
  for (const folder of folders) {
    for (const environment of ['.venv', 'venv']) {
      const candidate = path.join(folder, environment, ...inside);
      if (exists(candidate)) return candidate;
    }
  }
  return 'plctool';
}

/** The Python beside plctool, which has the packages of its tests; else the one on the PATH. */
export function pythonOf(tool: string, exists = existsSync): string {
  const beside = path.join(path.dirname(tool), process.platform === 'win32' ? 'python.exe' : 'python');
  return path.isAbsolute(tool) && exists(beside) ? beside : 'python3';
}

/** What plctool needs in its environment: the link of the settings, if there is one. */
export function environmentOf(link: string): Record<string, string> {
  return link === '' ? {} : { PLC_LINK: link };
}

/** The commands that `plctool --help` lists. */
export function commandsIn(help: string): Set<string> {
  return new Set([...help.matchAll(/^ {4}([a-z][a-z-]*)(?: |$)/gm)].map((match) => match[1] ?? ''));
}

export interface Ran {
  readonly stdout: string;
  readonly stderr: string;
  readonly code: number;
}

/** Runs plctool to its end. Raises ToolError if it cannot be started. */
export function run(tool: Tool, args: readonly string[], cwd: string, signal?: AbortSignal): Promise<Ran> {
  return new Promise((resolve, reject) => {
    const options = {
      cwd,
      env: { ...process.env, ...tool.environment },
      maxBuffer: 64 << 20,
      ...(signal === undefined ? {} : { signal }),
    };
    execFile(tool.path, args, options, (error, stdout, stderr) => {
      const code = error === null ? 0 : error.code;
      if (typeof code === 'number') resolve({ stdout, stderr, code });
      else reject(new ToolError(notStarted(tool.path, error)));
    });
  });
}

function notStarted(tool: string, error: { code?: unknown; message: string } | null): string {
  if (error?.code === 'ENOENT') {
    return `${tool} was not found. Install it with 'pip install plctool', or set plctool.path.`;
  }
  return `${tool} did not finish: ${error?.message ?? ''}`;
}

/** Runs plctool with --json and returns its document. Raises ToolError with its message if it reports an error. */
export async function runJson(
  tool: Tool,
  args: readonly string[],
  cwd: string,
  signal?: AbortSignal,
): Promise<JsonObject> {
  return documentOf(await run(tool, [...args, '--json'], cwd, signal));
}

/** The document of a command that ran. Raises ToolError for one that reports an error, or that printed none. */
export function documentOf(ran: Ran): JsonObject {
  let document: Json;
  try {
    document = JSON.parse(ran.stdout) as Json;
  } catch {
    throw new ToolError(ran.stderr.trim() || `plctool ended with exit code ${ran.code} and printed no document.`);
  }
  if (!isObject(document)) throw new ToolError('plctool printed no document.');
  const error = document.error;
  if (isObject(error)) throw new ToolError(text(error.message));
  return document;
}

/** The link that a plc.toml names; "" if it names none. */
export function linkIn(toml: string): string {
  const match = /^link\s*=\s*(?:"([^"\n]*)"|'([^'\n]*)')/m.exec(toml);
  return match?.[1] ?? match?.[2] ?? '';
}

/** The folder of the nearest plc.toml around a file, not above `root`; undefined if there is none. */
export function projectOf(file: string, root: string, exists = existsSync): string | undefined {
  for (let folder = path.dirname(file); isWithin(folder, root); folder = path.dirname(folder)) {
    if (exists(path.join(folder, 'plc.toml'))) return folder;
    if (path.dirname(folder) === folder) return undefined;
  }
  return undefined;
}

function isWithin(folder: string, root: string): boolean {
  const relative = path.relative(root, folder);
  return relative === '' || (!relative.startsWith('..') && !path.isAbsolute(relative));
}
