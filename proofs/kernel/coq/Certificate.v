(** Certificates of good values: a schedule that keeps the network, and that no schedule of the network breaks anything. *)

Require Import Reals QArith Qreals List Bool PArith ZArith Lra Lia FMapPositive Classical.
Require Import Spec Claims States Closed Kernel Checker Orders.
Import ListNotations.
Open Scope R_scope.

(** ** Lists *)

Fixpoint all2 {A B} (f : A -> B -> bool) (l : list A) (m : list B) : bool :=
  match l, m with
  | [], [] => true
  | x :: l, y :: m => f x y && all2 f l m
  | _, _ => false
  end.

Lemma all2_in {A B} (f : A -> B -> bool) l m x : all2 f l m = true -> In x l -> exists y, In y m /\ f x y = true.
Proof.
  revert m. induction l as [|a l IH]; intros [|b m]; simpl; try easy. rewrite andb_true_iff. intros [A1 A2] [->|I].
  - exists b. auto.
  - destruct (IH _ A2 I) as [y [J K]]. eauto.
Qed.

(** A list by numbers, from [k] on. *)
Fixpoint numbered {A} (l : list A) (k : positive) (m : M.t A) : M.t A :=
  match l with [] => m | x :: l => numbered l (Pos.succ k) (M.add k x m) end.

Definition table {A} (l : list A) : M.t A := numbered l 1 (M.empty A).

Lemma numbered_in {A} (l : list A) : forall k m n x, M.find n (numbered l k m) = Some x -> In x l \/ M.find n m = Some x.
Proof.
  induction l as [|y l IH]; simpl; intros k m n x H; auto. apply IH in H as [H|H]; auto.
  destruct (Pos.eq_dec n k) as [->|D]; [rewrite M.gss in H; inversion H; auto | rewrite M.gso in H by auto; auto].
Qed.

Lemma table_in {A} (l : list A) n x : M.find n (table l) = Some x -> In x l.
Proof. intros H. apply numbered_in in H as [H|H]; auto. now rewrite M.gempty in H. Qed.

Fixpoint each {A} (f : positive -> A -> bool) (k : positive) (l : list A) : bool :=
  match l with [] => true | x :: l => f k x && each f (Pos.succ k) l end.

Lemma each_in {A} (f : positive -> A -> bool) l x : forall k, each f k l = true -> In x l -> exists n, f n x = true.
Proof. induction l as [|a l IH]; simpl; [easy|]. intros k. rewrite andb_true_iff. intros [A1 A2] [->|I]; eauto. Qed.

(** ** Regions of parameter values, and multiples of what is known *)

(** An expression with expressions for its time points. *)
Fixpoint placed (times : nat -> expr) (e : expr) : expr :=
  match e with
  | Time p => times p
  | Plus a b => Plus (placed times a) (placed times b)
  | Minus a b => Minus (placed times a) (placed times b)
  | Scale q a => Scale q (placed times a)
  | _ => e
  end.

Definition fixed (e : expr) : lin := lin_of (placed (fun _ => Num 0) e).
Definition region_facts (region : list (expr * bool)) : list (lin * bool) := map (fun x => (fixed (fst x), snd x)) region.

Definition facts := M.t (lin * bool).
Definition facts_hold (v : var -> R) (k : facts) : Prop := forall n e s, M.find n k = Some (e, s) -> above s (at_ v e).

(** [e >= 0], or [> 0] if strict. *)
Definition implied (k : facts) (strict : bool) (e : lin) (multiples : list (positive * Q)) : bool :=
  match weigh_facts k (minus zero_lin e, negb strict) multiples with Some f => absurd_fact f | None => false end.

Lemma implied_true v k s e ms : facts_hold v k -> implied k s e ms = true -> above s (at_ v e).
Proof.
  unfold implied. destruct (weigh_facts _ _ ms) as [f|] eqn:W; [|easy]. intros F A. apply NNPP. intros N.
  apply (facts_above v) in W; auto.
  - exact (absurd_fact_false v _ A W).
  - cbn [fst snd]. rewrite minus_at, zero_lin_at. destruct s; simpl in *; lra.
Qed.

Lemma placed_at g times t : (forall p, t p = ev g (fun _ => 0) (times p)) ->
  forall e, ev g (fun _ => 0) (placed times e) = ev g t e.
Proof. intros T. induction e; simpl; rewrite <- ?IHe1, <- ?IHe2, <- ?IHe, ?T; auto. Qed.

Lemma fixed_at v g e : (forall i, v (VPar i) = g i) -> at_ v (fixed e) = ev g (fun _ => 0) e.
Proof.
  intros G. unfold fixed. rewrite (lin_of_at g v (fun p => v (VTime p))) by auto.
  induction e; simpl; rewrite ?IHe1, ?IHe2, ?IHe, ?zero_R; auto.
Qed.

Lemma region_facts_hold v g region f : (forall i, v (VPar i) = g i) -> inside g region ->
  In f (region_facts region) -> above (snd f) (at_ v (fst f)).
Proof. intros G H I. apply in_map_iff in I as [[e s] [<- I]]. cbn [fst snd]. rewrite (fixed_at v g) by auto. now apply H. Qed.

Lemma table_holds v l : (forall f, In f l -> above (snd f) (at_ v (fst f))) -> facts_hold v (table l).
Proof. intros H n e s F. apply table_in in F. now apply H in F. Qed.

(** ** A schedule that is linear in the parameters *)

Record placement := {
  times : list expr;                   (* of all time points *)
  keeps : list (list (positive * Q))   (* for each constraint, multiples of the facts of the region *)
}.

Definition moved (l : list expr) : nat -> expr :=
  let known := table l in fun p => match M.find (key p) known with Some e => e | None => Num 0 end.

Definition keeps_edge (k : facts) (at_point : nat -> expr) (e : nat * nat * expr) (ms : list (positive * Q)) : bool :=
  match e with (a, b, w) => implied k false (lin_of (placed at_point (Minus (Minus (Time b) (Time a)) w))) ms end.

Definition scheduled (P : plan) (region : list (expr * bool)) (s : placement) : bool :=
  let at_point := moved (times s) in
  let k := table (region_facts region) in
  zero (lin_of (at_point 0%nat)) && all2 (keeps_edge k at_point) (edges P) (keeps s).

Definition schedule_of (g : nat -> R) (l : list expr) (p : nat) : R := ev g (fun _ => 0) (moved l p).

Theorem scheduled_kept P region s g : scheduled P region s = true -> inside g region ->
  kept P g (schedule_of g (times s)).
Proof.
  unfold scheduled. rewrite andb_true_iff. intros [Z K] G.
  pose (v := fun x => match x with VPar i => g i | _ => 0 end).
  assert (L : forall e, at_ v (lin_of e) = ev g (fun _ => 0) e) by (intros e; apply lin_of_at; auto). split.
  - unfold schedule_of. rewrite <- L. now apply zero_at.
  - intros a b w I. destruct (all2_in _ _ _ _ K I) as [ms [_ H]]. apply (implied_true v) in H.
    + rewrite L, (placed_at g _ (schedule_of g (times s))) in H by reflexivity. simpl in H. lra.
    + apply table_holds. intros f. apply (region_facts_hold v g); auto.
Qed.

(** ** Refutations *)

Record refutation := {
  nodes : list node;
  roots : list (positive * lit);   (* numbers of formulas, and the literals that stand for them *)
  steps : list step
}.

(** That formulas contradict each other, and what is known. *)
Definition refutes (k : facts) (claims : list form) (r : refutation) : bool :=
  match build (nodes r) 1 (M.empty node) with
  | Some c =>
      let known := table claims in
      forallb (fun x => match M.find (fst x) known with Some f => stands c f (snd x) | None => false end) (roots r) &&
      let units := map (fun x => [snd x]) (roots r) in
      run c k (table units) (Pos.of_succ_nat (length units)) (steps r)
  | None => false
  end.

Lemma refutes_false v k claims r : refutes k claims r = true -> facts_hold v k -> (forall f, In f claims -> fval v f) -> False.
Proof.
  unfold refutes. intros H F T. destruct (build _ _ _) as [c|] eqn:B; [|easy].
  apply (build_exists v) in B as [val R]. apply andb_true_iff in H as [X Y].
  apply (run_contradicts v c k val R F) in Y; auto.
  intros n d D. apply table_in in D. apply in_map_iff in D as [[m l] [<- I]]. exists l. split; [now left|].
  rewrite forallb_forall in X. apply X in I. cbn [fst snd] in I. destruct (M.find m _) as [f|] eqn:E; [|easy].
  apply (stands_for v c val R) in I. apply I, T. exact (table_in _ _ _ E).
Qed.

Definition refuted (k : facts) (o : orders) (i : place) (first : form) (others : unit -> list form)
    (r : option refutation) : bool :=
  let (claim, rest) := simplified o i first others in
  match claim, r with
  | FNot FTrue, _ => true
  | _, Some r => refutes k (claim :: rest) r
  | _, None => false
  end.

Lemma refuted_false P g t time k o i first others r : let v := valuation P g t time in
  refuted k o i first others r = true -> facts_hold v k -> ordered t o -> in_it t time i ->
  fval v first -> (forall f, In f (others tt) -> fval v f) -> False.
Proof.
  intros v H F O N T S. unfold refuted in H. pose proof (simplified_true P g t time o i O N first others T S) as A.
  destruct (simplified o i first others) as [claim rest]. destruct A as [A B].
  assert (X : claim <> FNot FTrue) by (intros ->; now apply A).
  destruct r as [r|]; [|destruct claim as [| | [] |]; easy]. apply (refutes_false v k (claim :: rest) r); auto.
  - destruct claim as [| | [] |]; easy.
  - intros f [<-|I]; auto.
Qed.

(** ** Order lemmas *)

Definition edge_fact (e : nat * nat * expr) : lin * bool :=
  match e with (a, b, w) => (minus (minus (tm b) (tm a)) (lin_of w), false) end.

(** [t_b - t_a >= k], by multiples of facts and of earlier lemmas. *)
Definition lemma := (nat * nat * Q * list (positive * Q))%type.

Fixpoint learn (k : facts) (next : positive) (o : orders) (l : list lemma) : option (facts * orders) :=
  match l with
  | [] => Some (k, o)
  | (a, b, q, ms) :: rest =>
      let e := minus (minus (tm b) (tm a)) (q, []) in
      if implied k false e ms then learn (M.add next (e, false) k) (Pos.succ next) (learnt o a b q) rest else None
  end.

Lemma learn_holds P g t time : let v := valuation P g t time in
  forall l k next o k' o', facts_hold v k -> ordered t o -> learn k next o l = Some (k', o') ->
  facts_hold v k' /\ ordered t o'.
Proof.
  intros v. induction l as [|[[[a b] q] ms] l IH]; simpl; intros k next o k' o' F O.
  - intros H. inversion H. now subst.
  - destruct (implied k false _ ms) eqn:A; [|easy]. apply (implied_true v) in A; auto.
    assert (L : Q2R q <= t b - t a) by (unfold v in A; rewrite !minus_at, !tm_at, number_at in A; simpl in A; lra).
    apply IH; [|now apply learnt_ordered].
    intros n e s. destruct (Pos.eq_dec n next) as [->|D]; [|rewrite M.gso by auto; apply F].
    rewrite M.gss. intros H. inversion H. subst. exact A.
Qed.

(** ** All obligations *)

Definition marked (l : list nat) : M.t unit := fold_right (fun p m => M.add (key p) tt m) (M.empty unit) l.

Lemma marked_in l p x : M.find (key p) (marked l) = Some x -> In p l.
Proof.
  induction l as [|q l IH]; simpl; [now rewrite M.gempty|].
  destruct (Pos.eq_dec (key p) (key q)) as [E|E]; [apply SuccNat2Pos.inj in E; auto|]. rewrite M.gso by auto. auto.
Qed.

Definition place_of (happening : M.t unit) (b : obligation) : place :=
  match b with
  | Keep (OverAll s e _) => Inside s e
  | Keep (Goal _) => AfterAll happening
  | _ => Anywhere
  end.

Lemma placed_in P t b time : looked_at P t b time -> in_it t time (place_of (marked (happenings P)) b).
Proof. destruct b as [p q | [p c | s e c | c]]; simpl; auto. intros H p x I. apply marked_in in I. auto. Qed.

Record proofs := {
  lemmas : list lemma;
  refutations : list (positive * refutation)   (* by the numbers of the obligations that are not false by orders alone *)
}.

Definition known_of (P : plan) (region : list (expr * bool)) : list (lin * bool) :=
  region_facts region ++ map edge_fact (edges P).

Definition by_number {A} (l : list (positive * A)) : M.t A := fold_right (fun x m => M.add (fst x) (snd x) m) (M.empty A) l.

Definition start (P : plan) (region : list (expr * bool)) (l : list lemma) : option (facts * orders) :=
  let known := known_of P region in
  learn (table known) (Pos.of_succ_nat (length known)) (M.empty (M.t Q)) l.

Lemma start_holds P region l g t time k o : inside g region -> kept P g t -> start P region l = Some (k, o) ->
  facts_hold (valuation P g t time) k /\ ordered t o.
Proof.
  intros G [_ T] H. eapply (learn_holds P g t time); [| |exact H].
  - apply table_holds. intros f I. apply in_app_iff in I as [I|I]; [now apply (region_facts_hold (valuation P g t time) g region)|].
    apply in_map_iff in I as [[[a b] w] [<- I]]. cbn [edge_fact fst snd].
    rewrite !minus_at, !tm_at, (lin_of_at g _ t) by auto. apply T in I. simpl. lra.
  - intros a b q. unfold bound. now rewrite M.gempty.
Qed.

(** The mutex pairs, by what is used: only uses of one atom, or of one fluent, harm each other. *)
Definition used (u : use) : positive :=
  match u with
  | Reads (inl a) | Adds a | Deletes a => xO (key a)
  | Reads (inr f) | Increases f | Assigns f => xI (key f)
  end.

Definition by_used (l : list (nat * use)) : M.t (list (nat * use)) :=
  fold_right (fun x m => let k := used (snd x) in
    M.add k (x :: match M.find k m with Some l => l | None => [] end) m) (M.empty _) l.

Definition pair_of (both_timed : nat -> nat -> bool) (x y : nat * use) : list (nat * nat) :=
  if harms (snd x) (snd y) && negb (Nat.eqb (fst x) (fst y)) && negb (both_timed (fst x) (fst y))
  then [(Nat.min (fst x) (fst y), Nat.max (fst x) (fst y))] else [].

Definition a_set (l : list (nat * nat)) : M.t (M.t (nat * nat)) :=
  fold_right (fun x m => let k := key (fst x) in
    M.add k (M.add (key (snd x)) x match M.find k m with Some row => row | None => M.empty _ end) m) (M.empty _) l.

Definition both_timed (of_time : M.t unit) (p q : nat) : bool :=
  match M.find (key p) of_time, M.find (key q) of_time with Some _, Some _ => true | _, _ => false end.

Definition harming (P : plan) : list (nat * nat) :=
  let both := both_timed (marked (timed P)) in
  flat_map (fun l => flat_map (fun x => flat_map (pair_of both x) (snd l)) (snd l)) (M.elements (by_used (uses P))).

Definition pairs (P : plan) : list (nat * nat) :=
  flat_map (fun row => map snd (M.elements (snd row))) (M.elements (a_set (harming P))).

Lemma by_used_in l x : In x l -> exists m, M.find (used (snd x)) (by_used l) = Some m /\ In x m.
Proof.
  induction l as [|y l IH]; [easy|]. intros I. cbn [by_used fold_right]. fold (by_used l).
  destruct (Pos.eq_dec (used (snd x)) (used (snd y))) as [E|E].
  - rewrite E, M.gss. eexists. split; [reflexivity|]. destruct I as [->|I]; [now left|]. right.
    destruct (IH I) as [m [F J]]. rewrite E in F. now rewrite F.
  - rewrite M.gso by auto. destruct I as [->|I]; [now elim E | now apply IH].
Qed.

Lemma a_set_in l x : In x l -> exists row, M.find (key (fst x)) (a_set l) = Some row /\ M.find (key (snd x)) row = Some x.
Proof.
  induction l as [|y l IH]; [easy|]. intros I. cbn [a_set fold_right]. fold (a_set l).
  assert (Y : In x l -> exists row, M.find (key (fst x)) (a_set l) = Some row /\ M.find (key (snd x)) row = Some x) by auto.
  destruct (Pos.eq_dec (key (fst x)) (key (fst y))) as [E|E].
  - rewrite E, M.gss. eexists. split; [reflexivity|]. destruct (Pos.eq_dec (key (snd x)) (key (snd y))) as [D|D].
    + rewrite D, M.gss. apply SuccNat2Pos.inj in E. apply SuccNat2Pos.inj in D. destruct x, y. simpl in *. now subst.
    + rewrite M.gso by auto. destruct I as [->|I]; [now elim D|]. destruct (Y I) as [row [F G]]. rewrite E in F. now rewrite F.
  - rewrite M.gso by auto. destruct I as [->|I]; [now elim E | auto].
Qed.

Lemma harms_used u v : harms u v = true -> used u = used v.
Proof.
  destruct u as [[a|f] | a | a | f | f], v as [[b|h] | b | b | h | h]; simpl; try easy; intros H; apply Nat.eqb_eq in H; now subst.
Qed.

Lemma existsb_marked l p : existsb (Nat.eqb p) l = true -> M.find (key p) (marked l) <> None.
Proof.
  induction l as [|q l IH]; simpl; [easy|]. destruct (Pos.eq_dec (key p) (key q)) as [E|E].
  - intros _. now rewrite E, M.gss.
  - rewrite M.gso by auto. destruct (Nat.eqb_spec p q); [now subst | auto].
Qed.

Lemma marked_existsb l p x : M.find (key p) (marked l) = Some x -> existsb (Nat.eqb p) l = true.
Proof. intros H. apply marked_in in H. apply existsb_exists. exists p. split; auto. apply Nat.eqb_refl. Qed.

Lemma mutex_pairs P p q : In (p, q) (mutex P) -> In (p, q) (pairs P).
Proof.
  intros H. apply in_flat_map in H as [[x u] [I H]]. apply in_flat_map in H as [[y w] [J H]].
  destruct (harms u w && _ && _) eqn:E; [|easy]. destruct H as [H|[]]. inversion H. subst. clear H.
  apply andb_true_iff in E as [E T]. apply andb_true_iff in E as [E N].
  enough (F : In (Nat.min x y, Nat.max x y) (harming P)).
  { apply a_set_in in F as [row [F G]]. apply in_flat_map. exists (key (Nat.min x y), row).
    split; [apply M.elements_correct; exact F|]. apply in_map_iff. exists (key (Nat.max x y), (Nat.min x y, Nat.max x y)).
    split; auto. apply M.elements_correct. exact G. }
  apply by_used_in in I as [m [F I]]. apply by_used_in in J as [m' [F' J]]. cbn [snd] in F, F'.
  rewrite <- (harms_used _ _ E), F in F'. inversion F'. subst m'. apply in_flat_map.
  exists (used u, m). split; [apply M.elements_correct; exact F|]. apply in_flat_map. exists (x, u). split; auto. apply in_flat_map.
  exists (y, w). split; auto. unfold pair_of. cbn [fst snd]. rewrite E, N.
  assert (B : both_timed (marked (timed P)) x y = false).
  { unfold both_timed. apply negb_true_iff in T. destruct (M.find (key x) _) eqn:X; [|easy].
    destruct (M.find (key y) _) eqn:Y; [|easy]. apply marked_existsb in X. apply marked_existsb in Y. now rewrite X, Y in T. }
  rewrite B. now left.
Qed.

Lemma by_used_back l : forall k m x, M.find k (by_used l) = Some m -> In x m -> In x l.
Proof.
  induction l as [|y l IH]; intros k m x; cbn [by_used fold_right]; [now rewrite M.gempty|]. fold (by_used l).
  destruct (Pos.eq_dec k (used (snd y))) as [->|E].
  - rewrite M.gss. intros H. inversion H. subst. intros [->|I]; [now left|]. right.
    destruct (M.find (used (snd y)) (by_used l)) eqn:F; [eauto | easy].
  - rewrite M.gso by auto. intros H I. right. eauto.
Qed.

Lemma a_set_back l : forall k row k' x, M.find k (a_set l) = Some row -> M.find k' row = Some x -> In x l.
Proof.
  induction l as [|y l IH]; intros k row k' x; cbn [a_set fold_right]; [now rewrite M.gempty|]. fold (a_set l).
  destruct (Pos.eq_dec k (key (fst y))) as [->|E].
  - rewrite M.gss. intros H. inversion H. subst. destruct (Pos.eq_dec k' (key (snd y))) as [->|D].
    + rewrite M.gss. intros G. inversion G. now left.
    + rewrite M.gso by auto. intros G. right. destruct (M.find (key (fst y)) (a_set l)) eqn:F; [eauto|].
      now rewrite M.gempty in G.
  - rewrite M.gso by auto. intros H G. right. eauto.
Qed.

Lemma pairs_mutex P p q : In (p, q) (pairs P) -> In (p, q) (mutex P).
Proof.
  intros H. apply in_flat_map in H as [[k row] [I H]]. apply in_map_iff in H as [[k' x] [E J]]. cbn [snd] in *. subst x.
  apply M.elements_complete in I. apply M.elements_complete in J. pose proof (a_set_back _ _ _ _ _ I J) as H. clear I J.
  apply in_flat_map in H as [[k2 m] [I H]]. apply M.elements_complete in I. cbn [snd] in H.
  apply in_flat_map in H as [[x u] [X H]]. apply in_flat_map in H as [[y w] [Y H]].
  apply (by_used_back _ _ _ _ I) in X. apply (by_used_back _ _ _ _ I) in Y.
  unfold pair_of in H. cbn [fst snd] in H. destruct (harms u w && _ && _) eqn:E; [|easy]. destruct H as [H|[]].
  inversion H. subst. apply andb_true_iff in E as [E T]. apply in_flat_map. exists (x, u). split; auto.
  apply in_flat_map. exists (y, w). split; auto. rewrite E.
  assert (B : existsb (Nat.eqb x) (timed P) && existsb (Nat.eqb y) (timed P) = false).
  { apply not_true_is_false. intros B. apply andb_true_iff in B as [B1 B2]. apply existsb_marked in B1. apply existsb_marked in B2.
    unfold both_timed in T. destruct (M.find (key x) _); [|easy]. destruct (M.find (key y) _); easy. }
  rewrite B. now left.
Qed.

Definition obligations (P : plan) : list obligation :=
  map (fun pq => Apart (fst pq) (snd pq)) (pairs P) ++ map Keep (duties P ++ agreements (effects P)).

Lemma obligation_listed P b : an_obligation P b -> In b (obligations P).
Proof.
  intros H. apply in_app_iff. destruct b as [p q | d]; [left | right; now apply in_map].
  apply in_map_iff. exists (p, q). split; auto. now apply mutex_pairs.
Qed.

Lemma listed_obligation P b : In b (obligations P) -> an_obligation P b.
Proof.
  intros H. apply in_app_iff in H as [H|H]; apply in_map_iff in H as [x [<- I]]; [|exact I].
  destruct x. now apply pairs_mutex.
Qed.

(** ** What is established: all values of a region have a schedule, and no schedule of the network breaks anything.
    [also] are formulas over the parameters that are known to be true. *)

Definition none_breaks (P : plan) (epsilon : Q) (region : list (expr * bool)) (also : list form) (c : proofs) : bool :=
  let happening := marked (happenings P) in
  let found := by_number (refutations c) in
  supported P epsilon && match start P region (lemmas c) with
  | Some (k, o) =>
      each (fun n b => refuted k o (place_of happening b) (root P epsilon b) (fun _ => meant P b ++ also) (M.find n found))
        1 (obligations P)
  | None => false
  end.

Theorem none_breaks_safe P epsilon region also c g t : none_breaks P epsilon region also c = true -> inside g region ->
  kept P g t -> (forall time f, In f also -> fval (valuation P g t time) f) -> valid P epsilon g t.
Proof.
  unfold none_breaks. rewrite andb_true_iff. intros [E H]. destruct (start _ _ _) as [[k o]|] eqn:S; [|easy]. intros G K A.
  apply nothing_breaks; auto. intros b B time L R. apply obligation_listed in B.
  destruct (each_in _ _ _ _ H B) as [n F]. destruct (start_holds P region _ g t time k o G K S) as [X Y].
  refine (refuted_false P g t time _ _ _ _ _ _ F X Y _ R _).
  - now apply placed_in.
  - intros f I. apply in_app_iff in I as [I|I]; [|now apply A]. now apply (meant_true P g t b).
Qed.
