// Lines of a process that come in pieces.

export class Lines {
  private rest = '';

  /** The lines that are complete with another piece. */
  add(piece: string): string[] {
    const lines = (this.rest + piece).split('\n');
    this.rest = lines.pop() ?? '';
    return lines.map((line) => line.replace(/\r$/, '')).filter((line) => line !== '');
  }
}
