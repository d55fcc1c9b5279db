// The plctool of the workspace, with its settings.

import * as vscode from 'vscode';

import { commandsIn, environmentOf, findTool, projectOf, run, type Tool } from './tool';

export const LANGUAGE = 'iecst';

export function settings(): vscode.WorkspaceConfiguration {
  return vscode.workspace.getConfiguration('plctool');
}

/** The folders of the workspace that are on this machine. */
export function folders(): string[] {
  return (vscode.workspace.workspaceFolders ?? [])
    .filter((folder) => folder.uri.scheme === 'file')
    .map((folder) => folder.uri.fsPath);
}

export function tool(): Tool {
  return {
    path: findTool(settings().get('path', ''), folders()),
    environment: environmentOf(settings().get('link', '')),
  };
}

/** The folder in which plctool runs for a file; that of the first folder of the workspace for none. */
export function folderOf(file?: vscode.Uri): string | undefined {
  const folder = file === undefined ? undefined : vscode.workspace.getWorkspaceFolder(file);
  return folder?.uri.fsPath ?? folders()[0];
}

/** The project of a file; the file itself if it belongs to none, the folder of the workspace without a file. */
export function target(file?: vscode.Uri): { path: string; folder: string } | undefined {
  const folder = folderOf(file);
  if (folder === undefined) return undefined;
  if (file?.scheme !== 'file') return { path: folder, folder };
  return { path: projectOf(file.fsPath, folder) ?? file.fsPath, folder };
}

export function activeFile(): vscode.Uri | undefined {
  const document = vscode.window.activeTextEditor?.document;
  return document !== undefined && (document.languageId === LANGUAGE || document.fileName.endsWith('.toml'))
    ? document.uri
    : undefined;
}

/** The commands that this plctool has; none, after a message, if it does not start. */
export async function commands(): Promise<Set<string>> {
  try {
    return commandsIn((await run(tool(), ['--help'], folders()[0] ?? process.cwd())).stdout);
  } catch (error) {
    complain(error);
    return new Set();
  }
}

export function complain(error: unknown): void {
  void vscode.window.showErrorMessage(error instanceof Error ? error.message : String(error));
}
