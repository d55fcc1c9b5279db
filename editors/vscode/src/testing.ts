// The test explorer: TEST blocks by `plctool test`, tests of pytest by the Python beside plctool.

import { mkdtemp, readFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import * as path from 'node:path';
import * as vscode from 'vscode';

import { filterFor, findPythonTests, findTests, junitOutcomes, outcomesOf, type Outcome } from './discover';
import { settings, target, tool } from './setup';
import { pythonOf, run, runJson } from './tool';

const SOURCES = '**/*.{st,ST,iec}';
const PYTHON = '**/{test_*,*_test}.py';
const IGNORED = '**/{.venv,venv,node_modules,build*}/**';

export class Tests implements vscode.Disposable {
  private readonly controller = vscode.tests.createTestController('plctool', 'PLC program');
  private readonly registered: { dispose(): unknown }[] = [this.controller];

  constructor() {
    this.controller.createRunProfile(
      'Run',
      vscode.TestRunProfileKind.Run,
      (request, token) => this.run(request, token),
      true,
    );
    this.controller.refreshHandler = () => this.discover();
    this.controller.resolveHandler = () => this.discover();
    for (const pattern of [SOURCES, PYTHON]) this.follow(pattern);
    this.registered.push(
      vscode.workspace.onDidChangeTextDocument(({ document }) => { this.readOpen(document); }),
    );
  }

  private follow(pattern: string): void {
    const watcher = vscode.workspace.createFileSystemWatcher(pattern);
    const read = (file: vscode.Uri): void => void this.read(file);
    watcher.onDidCreate(read);
    watcher.onDidChange(read);
    watcher.onDidDelete((file) => { this.controller.items.delete(file.toString()); });
    this.registered.push(watcher);
  }

  private async discover(): Promise<void> {
    const sources = await vscode.workspace.findFiles(SOURCES, IGNORED);
    const others = withPytest() ? await vscode.workspace.findFiles(PYTHON, IGNORED) : [];
    await Promise.all([...sources, ...others].map((file) => this.read(file)));
  }

  private async read(file: vscode.Uri): Promise<void> {
    if (isPython(file) && !withPytest()) return;
    const content = await vscode.workspace.fs.readFile(file);
    this.take(file, new TextDecoder().decode(content));
  }

  private readOpen(document: vscode.TextDocument): void {
    if (this.controller.items.get(document.uri.toString()) !== undefined || document.languageId === 'iecst') {
      this.take(document.uri, document.getText());
    }
  }

  private take(file: vscode.Uri, content: string): void {
    const found = isPython(file) ? findPythonTests(content) : findTests(content);
    const key = file.toString();
    if (found.length === 0) {
      this.controller.items.delete(key);
      return;
    }
    const item = this.controller.items.get(key) ?? this.controller.createTestItem(key, path.basename(file.path), file);
    item.description = vscode.workspace.asRelativePath(path.dirname(file.fsPath));
    item.children.replace(
      found.map(({ name, line }) => {
        const child = this.controller.createTestItem(`${key}::${name}`, name, file);
        child.range = new vscode.Range(line, 0, line, 0);
        return child;
      }),
    );
    this.controller.items.add(item);
  }

  private async run(request: vscode.TestRunRequest, token: vscode.CancellationToken): Promise<void> {
    const wanted = this.leaves(request);
    const run = this.controller.createTestRun(request);
    const abort = new AbortController();
    token.onCancellationRequested(() => { abort.abort(); });
    wanted.forEach((item) => { run.started(item); });
    for (const [where, items] of grouped(wanted)) {
      try {
        await (isPython(items[0]?.uri) ? runPytest(run, where, items, abort) : runBlocks(run, where, items, abort));
      } catch (error) {
        const message = new vscode.TestMessage(error instanceof Error ? error.message : String(error));
        items.forEach((item) => { run.errored(item, message); });
      }
    }
    run.end();
  }

  private leaves(request: vscode.TestRunRequest): vscode.TestItem[] {
    const left = new Set(request.exclude ?? []);
    const found: vscode.TestItem[] = [];
    const visit = (item: vscode.TestItem): void => {
      if (left.has(item)) return;
      if (item.children.size === 0) found.push(item);
      else item.children.forEach(visit);
    };
    if (request.include === undefined) this.controller.items.forEach(visit);
    else request.include.forEach(visit);
    return found;
  }

  dispose(): void {
    vscode.Disposable.from(...this.registered).dispose();
  }
}

function isPython(file: vscode.Uri | undefined): boolean {
  return file?.path.endsWith('.py') === true;
}

function withPytest(): boolean {
  const said = settings().get<string>('pytest', 'auto');
  return said === 'on' || (said === 'auto' && vscode.extensions.getExtension('ms-python.python') === undefined);
}

/** The tests that one process runs: those of a project, or of a Python file. */
function grouped(items: readonly vscode.TestItem[]): Map<string, vscode.TestItem[]> {
  const groups = new Map<string, vscode.TestItem[]>();
  for (const item of items) {
    if (item.uri === undefined) continue;
    const where = isPython(item.uri) ? item.uri.fsPath : (target(item.uri)?.path ?? item.uri.fsPath);
    groups.set(where, [...(groups.get(where) ?? []), item]);
  }
  return groups;
}

async function runBlocks(
  run: vscode.TestRun,
  project: string,
  items: readonly vscode.TestItem[],
  abort: AbortController,
): Promise<void> {
  const cwd = target(items[0]?.uri)?.folder ?? path.dirname(project);
  const args = ['test', ...filterFor(items.map((item) => item.label)), project];
  const outcomes = outcomesOf(await runJson(tool(), args, cwd, abort.signal));
  for (const item of items) {
    const file = item.uri?.fsPath ?? '';
    report(run, item, outcomes.find((one) => one.name === item.label && path.resolve(cwd, one.file) === file));
  }
}

async function runPytest(
  run: vscode.TestRun,
  file: string,
  items: readonly vscode.TestItem[],
  abort: AbortController,
): Promise<void> {
  const folder = await mkdtemp(path.join(tmpdir(), 'plctool-'));
  try {
    const xml = path.join(folder, 'report.xml');
    const names = items.map((item) => `${file}::${item.label}`);
    const cwd = target(items[0]?.uri)?.folder ?? path.dirname(file);
    const python = { path: pythonOf(tool().path), environment: tool().environment };
    const ran = await startPytest(python, names, xml, cwd, abort.signal);
    const outcomes = junitOutcomes(await readFile(xml, 'utf8').catch(() => ''));
    if (outcomes.size === 0) throw new Error(ran);
    items.forEach((item) => { report(run, item, outcomes.get(item.label)); });
  } finally {
    await rm(folder, { recursive: true, force: true });
  }
}

async function startPytest(
  python: Parameters<typeof run>[0],
  names: readonly string[],
  xml: string,
  cwd: string,
  signal: AbortSignal,
): Promise<string> {
  const ran = await run(python, ['-m', 'pytest', '-q', `--junit-xml=${xml}`, ...names], cwd, signal);
  return (ran.stdout + ran.stderr).trim() || 'pytest reported nothing.';
}

function report(run: vscode.TestRun, item: vscode.TestItem, outcome: Outcome | undefined): void {
  if (outcome === undefined) {
    run.skipped(item);
  } else if (outcome.passed) {
    run.passed(item, outcome.milliseconds);
  } else {
    run.failed(item, messageOf(item, outcome), outcome.milliseconds);
  }
}

function messageOf(item: vscode.TestItem, outcome: Outcome): vscode.TestMessage {
  const message =
    outcome.expected === undefined
      ? new vscode.TestMessage(outcome.message)
      : vscode.TestMessage.diff(outcome.message, outcome.expected, outcome.actual ?? '');
  if (item.uri !== undefined && outcome.line !== undefined) {
    message.location = new vscode.Location(item.uri, new vscode.Position(outcome.line, 0));
  }
  return message;
}
