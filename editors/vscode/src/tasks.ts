// Tasks, and the commands that run as tasks: their terminal may ask for a password, their errors become problems.

import * as vscode from 'vscode';

import { isDuration, missingFor, stepOf, TASKS, taskArguments, type Action, type TaskName } from './actions';
import { activeFile, complain, folders, target, tool } from './setup';
import { run } from './tool';

const MATCHER = '$plctool';

interface Definition extends vscode.TaskDefinition {
  readonly command: TaskName;
  readonly project?: string;
  readonly args?: readonly string[];
}

export function registerTasks(): vscode.Disposable {
  return vscode.tasks.registerTaskProvider('plctool', {
    provideTasks: () =>
      (vscode.workspace.workspaceFolders ?? []).flatMap((folder) =>
        TASKS.map((command) => taskOf({ type: 'plctool', command }, folder)),
      ),
    resolveTask: (task) => {
      const folder = typeof task.scope === 'object' ? task.scope : vscode.workspace.workspaceFolders?.[0];
      return folder === undefined ? undefined : taskOf(task.definition as Definition, folder);
    },
  });
}

function taskOf(definition: Definition, folder: vscode.WorkspaceFolder): vscode.Task {
  const args = taskArguments(definition.command, definition.project, definition.args ?? []);
  const task = processTask(definition, folder, definition.command, args, folder.uri.fsPath);
  if (definition.command === 'build') task.group = vscode.TaskGroup.Build;
  if (definition.command === 'test') task.group = vscode.TaskGroup.Test;
  return task;
}

function processTask(
  definition: vscode.TaskDefinition,
  scope: vscode.WorkspaceFolder | vscode.TaskScope.Workspace,
  title: string,
  args: readonly string[],
  cwd: string,
): vscode.Task {
  const { path, environment } = tool();
  const execution = new vscode.ProcessExecution(path, [...args], { cwd, env: { ...environment } });
  return new vscode.Task(definition, scope, title, 'plctool', execution, MATCHER);
}

/** Saves, and runs a command for the project of the open file. */
export async function runAction(action: Action): Promise<void> {
  const of = target(activeFile());
  if (of === undefined) {
    complain('Open a folder or a file of Structured Text first.');
    return;
  }
  const time = action === 'simulate' ? await askForTime() : undefined;
  if (action === 'simulate' && time === undefined) return;
  const missing = action === 'onlineChange' ? await missingOnlineChange(of.folder) : undefined;
  if (missing !== undefined) {
    complain(missing);
    return;
  }
  await vscode.workspace.saveAll(false);
  const step = stepOf(action, vscode.workspace.asRelativePath(of.path, false), time);
  const definition = { type: 'plctool', command: action };
  const scope = vscode.workspace.workspaceFolders?.[0] ?? vscode.TaskScope.Workspace;
  await vscode.tasks.executeTask(processTask(definition, scope, step.title, step.args, of.folder));
}

async function missingOnlineChange(folder: string): Promise<string | undefined> {
  try {
    return missingFor('onlineChange', (await run(tool(), ['flash', '--help'], folder)).stdout);
  } catch (error) {
    return error instanceof Error ? error.message : String(error);
  }
}

function askForTime(): Thenable<string | undefined> {
  return vscode.window.showInputBox({
    title: 'Run in the simulator',
    prompt: 'How long, on its virtual clock',
    value: 'T#10s',
    validateInput: (text) => (isDuration(text) ? undefined : 'Write a duration such as T#10s or T#1m30s.'),
  });
}

/** Starts the page of a controller or of the simulator; its address opens in the browser. */
export function openPage(isSimulated: boolean): void {
  const of = target(activeFile());
  if (of === undefined) {
    complain('Open a folder or a file of Structured Text first.');
    return;
  }
  const { path, environment } = tool();
  const args = ['ui', '--open', ...(isSimulated ? ['--sim', of.path] : [])];
  const terminal = vscode.window.createTerminal({
    name: 'plctool ui',
    shellPath: path,
    shellArgs: args,
    cwd: folders()[0] ?? of.folder,
    env: { ...environment },
  });
  terminal.show(true);
}
